/* The step of every tracker that decides at a tentative collision: the next one, and one lookup there. */
static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask here = next_tentative(path, scene, rng);
    at_tentative(path, scene, rng, here, sigma_t_at_tentative(path, scene, here));
}
