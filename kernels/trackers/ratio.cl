/*---
title: Ratio tracking
estimands: [transmittance]
needs: [majorant]
citation: Novak, Selle, Jarosz 2014, Residual ratio tracking for estimating attenuation in participating media
---*/
/* No collision is real: the weight is the product of the null probabilities sigma_n / majorant. Where the
   majorant does not bound, sigma_n is negative and the weight changes its sign; it stays unbiased. */
static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
    const real sigma_n = path->majorant - sigma_t;
    /* A quotient, not a product with mean_free_path: it is exactly 1 in empty space and exactly 0 where the
       majorant is met, and its rounding has no sign that many collisions would add up. */
    const real null = sigma_n / path->majorant;
    path->weight = choose(here, path->weight * null, path->weight);
}
