/*---
title: Spectral tracking
estimands: [transmittance, free_path, radiance, path_length]
needs: [majorant]
channels: any
parameters:
  probability:
    choices: [maximum, average, history_maximum, history_average]
    default: history_average
    meaning: >-
      how a tentative collision is classified: in proportion to the largest or the average coefficient of all
      channels, or the same of the coefficients times the channels' weights so far
citation: >-
  Kutz, Habel, Li, Novak 2017, Spectral and decomposition tracking for rendering heterogeneous volumes (section 5)
---*/
/* One path for all channels. An event has one probability for all, and each channel's weight makes good for it:
   (coefficient / majorant) / probability. */
#if PROBABILITY == PROBABILITY_MAXIMUM || PROBABILITY == PROBABILITY_HISTORY_MAXIMUM
#define JOIN_CHANNELS(all, one) larger(all, one)
#else
#define JOIN_CHANNELS(all, one) ((all) + (one))
#endif

static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here, const real sigma_t)
{
    real ends = (real)0, null = (real)0;
    for (int c = 0; c < CHANNELS; ++c) {
        real extinction = sigma_t * scene->channels.extinction[c];
        real sigma_n = fabs(path->majorant - extinction);
#if PROBABILITY == PROBABILITY_HISTORY_MAXIMUM || PROBABILITY == PROBABILITY_HISTORY_AVERAGE
        extinction *= fabs(path->state.throughput[c]);
        sigma_n *= fabs(path->state.throughput[c]);
#endif
        ends = JOIN_CHANNELS(ends, extinction);
        null = JOIN_CHANNELS(null, sigma_n);
    }
    const mask collided = here & less(uniform(rng) * (ends + null), ends);
    const real scale = (ends + null) / (choose(collided, ends, null) * path->majorant);
    for (int c = 0; c < CHANNELS; ++c) {
        const real extinction = sigma_t * scene->channels.extinction[c];
        scale_throughput(path, c, choose(collided, extinction, path->majorant - extinction) * scale, here);
    }
    collide(path, collided);
}
