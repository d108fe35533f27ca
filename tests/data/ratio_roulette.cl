/*---
title: Ratio tracking with Russian roulette
estimands: [transmittance]
needs: [majorant]
bounding: false
unbiased: true
parameters:
  threshold: {default: 0.1, above: 0, maximum: 1, meaning: weights below it are played for}
citation: Novak, Selle, Jarosz 2014, Residual ratio tracking for estimating attenuation in participating media
---*/
/* Ratio tracking, whose small weights end or are raised: a path that is worth little costs little. */
static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
    const real sigma_n = path->majorant - sigma_t;
    const real weight = path->weight * (sigma_n / path->majorant);
    const real survival = fabs(weight) / scene->tracker.threshold;
    const mask plays = here & less(survival, (real)1);
    const mask survives = plays & less(uniform(rng), survival);
    path->weight = choose(here, choose(survives, weight / survival, weight), path->weight);
    collide(path, plays & ~survives);
}
