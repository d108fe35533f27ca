/*---
title: Analytic inversion of the CDF
estimands: [transmittance, free_path, radiance, path_length]
needs: [closed_form]
citation: Novak, Georgiev, Hanika, Jarosz 2018, Monte Carlo methods for volumetric light transport simulation
---*/
/* Solves tau(t) = -log(1 - u) in closed form. As an estimate of transmittance it is exp(-tau), exactly. */
static void begin(Path *path, const Scene *scene, Rng *rng) { path->target = sampled_depth(rng); }

static void step(Path *path, const Scene *scene, Rng *rng)
{
    path->depth = optical_depth(path, scene, path->ray.length);
    const mask here = path->live & less(path->target, path->depth);
    if (any_lane(here))
        path->t = choose(here, distance_to(path, scene, path->target), path->t);
    collide(path, here);
    escape_through_depth(path, path->live);
}
