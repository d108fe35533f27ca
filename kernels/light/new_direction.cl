/* Where a path goes on to: as the phase function has it. */
static Vector new_direction(Path *path, const Scene *scene, Rng *rng, const mask on)
{
    const real cosine = sample_cosine(scene, rng);
    return around(heading(path, scene), cosine, sine_of(cosine), rng);
}
