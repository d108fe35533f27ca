/*---
title: A path has a weight for each channel
state: {throughput: spectrum, collected: spectrum}
---*/
/* What a path scores in each channel: its weight, which all channels share, times its throughput. */
static void channels_begin(Path *path)
{
    for (int c = 0; c < CHANNELS; ++c) {
        path->state.throughput[c] = (real)1;
        path->state.collected[c] = (real)0;
    }
}

static real weight_of(const Path *path, const int channel) { return path->weight * path->state.throughput[channel]; }

/* Lanes `where` have the weight of a channel multiplied. */
static void scale_throughput(Path *path, const int channel, const real factor, const mask where)
{
    real *throughput = &path->state.throughput[channel];
    *throughput = choose(where, *throughput * factor, *throughput);
}

static void collect(Path *path, const int channel, const real value, const mask where)
{
    real *sum = &path->state.collected[channel];
    *sum = choose(where, *sum + value, *sum);
}

static real score_of(const Path *path, const int channel)
{
    return path->state.collected[channel] + score(weight_of(path, channel), path->t, path->escaped);
}

/* The extinction at a tentative collision before it is multiplied by each channel's own,
   scene->channels.extinction[c]: one lookup serves all. What exceeds the majorant in any channel by more than
   the rounding of an interpolation is a violation. */
static real sigma_t_at_tentative(Path *path, const Scene *scene, const mask here)
{
    const real sigma = sigma_t(path, scene, path->t, here);
    count(path->violations, here & less(path->majorant * (SCALAR)1.000001, sigma * scene->channels.largest));
    return sigma;
}
