/*---
title: Ratio tracking
estimands: [transmittance]
needs: [majorant]
channels: 1
bounding: false
unbiased: true
parameters: {}
citation: Novak, Selle, Jarosz 2014, Residual ratio tracking for estimating attenuation in participating media
---*/
/* No collision is real: the weight is the product of the null probabilities sigma_n / majorant. Where the
   majorant does not bound, sigma_n is negative and the weight changes its sign; it stays unbiased. */
static void begin(Path *path, const Scene *scene, Rng *rng) { walk_begin(path, scene); }

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask here = next_tentative(path, scene, rng);
    const real sigma_n = path->majorant - sigma_t_at_tentative(path, scene, here);
    path->weight = choose(here, path->weight * sigma_n * path->mean_free_path, path->weight);
}
