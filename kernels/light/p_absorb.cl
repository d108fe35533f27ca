/* A path is absorbed at a collision with a chance of its own, P_absorb, whatever the albedo and its weights; what goes
   on is divided by the chance that it did. Returns the lanes that end. The albedo is in the weights already. */
static mask roulette(Path *path, const Scene *scene, Rng *rng, const mask on)
{
    const mask ended = on & less(uniform(rng), (real)scene->optics.p_absorb);
    const SCALAR survival = (SCALAR)1 - scene->optics.p_absorb;
    path->weight = choose(on & ~ended, path->weight / survival, path->weight);
    return ended;
}
