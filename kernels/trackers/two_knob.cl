/*---
title: Null-collision tracking with free sampling rate and acceptance
estimands: [transmittance, free_path, radiance, path_length]
needs: [majorant]
parameters:
  acceptance:
    default: 1
    minimum: 0
    maximum: 1e6
    meaning: odds of real against null collisions, relative to sigma_t / |sigma_n|; 0 accepts none
citation: >-
  Galtier, Blanco, Caliot et al. 2013, Integral formulation of null-collision Monte Carlo algorithms;
  Szirmay-Kalos, Georgiev, Magdics, Molnar, Legrady 2017, Unbiased light transport estimators for
  inhomogeneous participating media
---*/
/* The form behind its relatives. The sampling rate is the majorant times tightness; a tentative collision is
   real with probability a sigma_t / (a sigma_t + |sigma_n|). a = 1 is delta tracking where the majorant
   bounds, a = 0 ratio tracking, and what lies between is ratio tracking with ever more Russian roulette. */
static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
    const real sigma_n = path->majorant - sigma_t;
    const SCALAR acceptance = scene->tracker.acceptance;
    const real both = acceptance * sigma_t + fabs(sigma_n);
    const mask collided = here & less(uniform(rng) * both, acceptance * sigma_t);
    const real sign = choose(less(sigma_n, (real)0), (real)-1, (real)1);
    const real share = choose(collided, both / (acceptance > 0 ? acceptance : (SCALAR)1), sign * both);
    const real relative = share / path->majorant;
    path->weight = choose(here, path->weight * relative, path->weight);
    collide(path, collided);
}
