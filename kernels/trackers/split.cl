/*---
title: Splitting into the real and the null branch
estimands: [transmittance, free_path]
needs: [majorant]
citation: >-
  Eymet, Poitou, Galtier, El Hafi, Terree, Fournier 2013, Null-collision meshless Monte Carlo;
  Szirmay-Kalos, Georgiev, Magdics, Molnar, Legrady 2017, Unbiased light transport estimators for
  inhomogeneous participating media (the double particle model)
---*/
/* Both branches are followed, with the weights sigma_t / majorant and sigma_n / majorant. The real branch ends
   where it begins, so it is scored at once and no stack is needed; the null branch flies on. */
static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
    const real real_share = sigma_t / path->majorant;
    const real null_share = (path->majorant - sigma_t) / path->majorant;
    splat(path, path->weight * real_share, path->t, (mask)0, here);
    path->weight = choose(here, path->weight * null_share, path->weight);
}
