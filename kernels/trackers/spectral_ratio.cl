/*---
title: Ratio tracking of every channel
estimands: [transmittance]
needs: [majorant]
shares_lookup: true
channels: any
citation: >-
  Novak, Selle, Jarosz 2014, Residual ratio tracking for estimating attenuation in participating media; Kutz,
  Habel, Li, Novak 2017, Spectral and decomposition tracking for rendering heterogeneous volumes
---*/
/* No collision is real, so no channel needs to be chosen for: each has the product of its null probabilities. */
static void begin(Path *path, const Scene *scene, Rng *rng) { walk_begin(path, scene); }

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask here = next_tentative(path, scene, rng);
    const real sigma = sigma_t_at_tentative(path, scene, here);
    for (int c = 0; c < CHANNELS; ++c)
        tint(path, c, (path->majorant - sigma * scene->channels.extinction[c]) / path->majorant, here);
}
