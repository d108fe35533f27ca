/*---
title: Weighted delta tracking
estimands: [transmittance, free_path, radiance, path_length]
needs: [majorant]
bounding: {probability: [analog]}
single_flight: {probability: [no_absorption]}
parameters:
  probability:
    choices: [analog, abs_null, no_absorption]
    default: abs_null
    meaning: >-
      how a tentative collision is classified: as delta tracking does; in proportion to sigma_t and
      |sigma_n|; or in proportion to sigma_s and |sigma_n|, absorption being scored at every one
  albedo:
    default: 0.8
    minimum: 0
    maximum: 1
    meaning: sigma_s / sigma_t, for no_absorption
citation: >-
  Galtier, Blanco, Caliot et al. 2013, Integral formulation of null-collision Monte Carlo algorithms;
  Novak, Georgiev, Hanika, Jarosz 2018, Monte Carlo methods for volumetric light transport simulation
---*/
/* The probabilities are free, and the weight makes good for them: (sigma / majorant) / P for the event that
   was chosen. Where the majorant does not bound, sigma_n is negative and so is the weight of null collisions. */
static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
#if PROBABILITY == PROBABILITY_ANALOG
    const mask collided = here & less(uniform(rng) * path->majorant, sigma_t);
#else
    const real sigma_n = path->majorant - sigma_t;
#if PROBABILITY == PROBABILITY_NO_ABSORPTION
    const real ends = scene->tracker.albedo * sigma_t;
    splat(path, path->weight * (sigma_t - ends) / path->majorant, path->t, (mask)0, here);
#else
    const real ends = sigma_t;
#endif
    const real both = ends + fabs(sigma_n);
    const mask collided = here & less(uniform(rng) * both, ends);
    const real sign = choose(collided | less((real)0, sigma_n), (real)1, (real)-1);
    const real share = sign * both / path->majorant;
    path->weight = choose(here, path->weight * share, path->weight);
#endif
    collide(path, collided);
}
