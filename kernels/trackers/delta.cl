/*---
title: Delta tracking
estimands: [transmittance, free_path, radiance, path_length]
needs: [majorant]
bounding: true
citation: >-
  Woodcock, Murphy, Hemmings, Longworth 1965, Techniques used in the GEM code for Monte Carlo neutronics
  calculations; Raab, Seibert, Keller 2008, Unbiased global illumination with participating media
---*/
/* A tentative collision is real with probability sigma_t / majorant; a path that has none escapes with
   weight 1, which estimates transmittance by a binary variable. */
static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
    collide(path, here & less(uniform(rng) * path->majorant, sigma_t));
}
