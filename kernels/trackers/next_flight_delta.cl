/*---
title: Next-flight delta tracking
estimands: [transmittance]
needs: [majorant]
bounding: true
state: {total: real}
citation: >-
  Cramer 1978, Application of the fictitious scattering model for deep-penetration Monte Carlo
  calculations; Novak, Georgiev, Hanika, Jarosz 2018, Monte Carlo methods for volumetric
  light transport simulation (section 4.2)
---*/
/* Next-flight ratio tracking with the null probability played instead of multiplied: a real collision ends
   the flight, so that what is behind it costs no lookups. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    path->weight = (real)0;
    path->state.total = majorant_depth(path, scene);
    splat(path, exp(-path->state.total), path->ray.length, (mask)-1, (mask)-1);
}

static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
    collide(path, here & less(uniform(rng) * path->majorant, sigma_t));
    const mask null = here & path->live;
    const real ahead = majorant_depth_ahead(path, scene, path->state.total, null);
    splat(path, exp(-ahead), path->ray.length, (mask)-1, null);
}
