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
static void begin(Path *path, const Scene *scene, Rng *rng) { walk_begin(path, scene); }

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask here = next_tentative(path, scene, rng);
    const real sigma = sigma_t_at_tentative(path, scene, here);
    const real share = path->weight * path->mean_free_path;
    deposit(path, share * sigma, path->t, (mask)0, here);
    path->weight = choose(here, share * (path->majorant - sigma), path->weight);
}
