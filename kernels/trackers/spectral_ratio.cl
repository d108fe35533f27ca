/*---
title: Ratio tracking of every channel
estimands: [transmittance]
needs: [majorant]
channels: any
citation: >-
  Novak, Selle, Jarosz 2014, Residual ratio tracking for estimating attenuation in participating media; Kutz,
  Habel, Li, Novak 2017, Spectral and decomposition tracking for rendering heterogeneous volumes
---*/
/* No collision is real, so no channel needs to be chosen for: each has the product of its null probabilities. */
static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
    for (int c = 0; c < CHANNELS; ++c)
        scale_throughput(path, c, (path->majorant - sigma_t * scene->channels.extinction[c]) / path->majorant, here);
}
