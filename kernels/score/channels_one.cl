/*---
title: A path has one weight
state: {collected: real}
---*/
/* What a path scores, in a medium or for a tracker of one channel. path->state.collected is what it has scored on its
   way, beside what the end of the flight will score. */
static void channels_begin(Path *path) { path->state.collected = (real)0; }

static real weight_of(const Path *path, const int channel) { return path->weight; }

static void scale_throughput(Path *path, const int channel, const real factor, const mask where)
{
    path->weight = choose(where, path->weight * factor, path->weight);
}

static void collect(Path *path, const int channel, const real value, const mask where)
{
    path->state.collected = choose(where, path->state.collected + value, path->state.collected);
}

static real score_of(const Path *path, const int channel)
{
    return path->state.collected + score(path->weight, path->t, path->escaped);
}

/* Lanes `where` score a part of their weight as if the flight ended at t, and fly on. */
static void splat(Path *path, const real weight, const real t, const mask escaped, const mask where)
{
    const real part = score(weight, t, escaped);
    path->state.collected = choose(where, path->state.collected + part, path->state.collected);
}

/* The extinction at a tentative collision. What exceeds the majorant by more than the rounding of an
   interpolation is a violation. */
static real sigma_t_at_tentative(Path *path, const Scene *scene, const mask here)
{
    const real sigma = sigma_t(path, scene, path->t, here);
    count(path->violations, here & less(path->majorant * (SCALAR)1.000001, sigma));
    return sigma;
}
