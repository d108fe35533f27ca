/* Forward or backward with equal chances: the rod model, whose reflection and transmission have closed forms. */
static real sample_cosine(const Scene *scene, Rng *rng)
{
    return choose(less(uniform(rng), (real)(SCALAR)0.5), (real)-1, (real)1);
}
