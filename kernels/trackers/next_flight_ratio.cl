/*---
title: Next-flight ratio tracking
estimands: [transmittance]
needs: [majorant]
state: {survival: real, total: real}
citation: >-
  Cramer 1978, Application of the fictitious scattering model for deep-penetration Monte Carlo
  calculations; Novak, Georgiev, Hanika, Jarosz 2018, Monte Carlo methods for volumetric
  light transport simulation (section 4.2)
---*/
/* At the start and after every null collision the chance of flying out without another tentative collision,
   exp(-majorant depth ahead), is scored; the flight itself only finds the collisions. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    path->weight = (real)0;
    path->state.survival = (real)1;
    path->state.total = majorant_depth(path, scene);
    splat(path, exp(-path->state.total), path->ray.length, (mask)-1, (mask)-1);
}

static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
    const real sigma_n = path->majorant - sigma_t;
    const real survival = path->state.survival * (sigma_n / path->majorant);
    path->state.survival = choose(here, survival, path->state.survival);
    const real ahead = majorant_depth_ahead(path, scene, path->state.total, here);
    splat(path, survival * exp(-ahead), path->ray.length, (mask)-1, here);
}
