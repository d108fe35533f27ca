/*---
title: Ray marching
estimands: [transmittance, free_path, radiance, path_length]
needs: []
unbiased: false
parameters:
  step: {unit: length, default: 0.01, above: 0, meaning: length of a step}
  placement:
    choices: [start, midpoint, jittered, comb]
    default: midpoint
    meaning: where in its step the extinction is looked up; comb is one random place for all steps of a ray
state: {taken: real, offset: real}
citation: >-
  Perlin, Hoffert 1989, Hypertexture; Novak, Georgiev, Hanika, Jarosz 2018, Monte Carlo methods for volumetric
  light transport simulation (section 4.1)
---*/
/* Constant steps, each taken as homogeneous with the extinction of one point in it; the distance within
   the last step is analytic. Biased: the error falls with the step, in first order for its start, in
   second for its midpoint and for a comb, in third for a uniformly random point. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    path->target = sampled_depth(rng);
    path->state.taken = (real)0;
#if PLACEMENT == PLACEMENT_COMB
    path->state.offset = uniform(rng);
#endif
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    path->state.taken += (SCALAR)1;
    const real full = path->state.taken * scene->tracker.step;
    const real t_exit = smaller(full, path->ray.length);
    const real length = t_exit - path->t;
#if PLACEMENT == PLACEMENT_JITTERED
    const real sample = path->t + uniform(rng) * length;
#elif PLACEMENT == PLACEMENT_COMB
    const real sample = path->t + path->state.offset * length;
#elif PLACEMENT == PLACEMENT_MIDPOINT
    const real sample = path->t + (SCALAR)0.5 * length;
#else
    const real sample = path->t;
#endif
    const real sigma = sigma_t(path, scene, sample, path->live);
    const real depth = path->depth + sigma * length;
    const mask here = path->live & less(path->target, depth);
    path->t = choose(here, path->t + (path->target - path->depth) / sigma, path->t);
    collide(path, here);
    path->depth = choose(path->live, depth, path->depth);
    path->t = choose(path->live, t_exit, path->t);
    escape_through_depth(path, path->live & ~less(t_exit, path->ray.length));
}
