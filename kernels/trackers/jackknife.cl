/*---
title: Jackknife transmittance
estimands: [transmittance]
needs: []
unbiased: false
parameters:
  steps: {default: 8, minimum: 1, maximum: 100000, meaning: lookups of each of its two marches}
state:
  interval: real
  first: real
  second: mask
like: march
citation: Peters 2025, Jackknife transmittance and MIS weight estimation, ACM Transactions on Graphics 44 (6)
---*/
/* Two jittered marches, one after the other, give the independent optical depths X0 and X1. In the mean of exp(-X)
   the variance of X is the first term of the bias; cos((X0 - X1) / 2) takes that much off exp(-(X0 + X1) / 2). */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    path->state.interval = path->state.first = (real)0;
    path->state.second = (mask)0;
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const real length = path->ray.length / scene->tracker.steps;
    const real sigma = sigma_t(path, scene, (state->interval + uniform(rng)) * length, path->live);
    path->depth = choose(path->live, path->depth + sigma * length, path->depth);
    state->interval = choose(path->live, state->interval + 1, state->interval);
    const mask marched = path->live & ~less(state->interval, (real)scene->tracker.steps);
    const mask ended = marched & state->second;
    if (any_lane(ended)) {
        const real half_gap = (SCALAR)0.5 * (state->first - path->depth);
        const real middle = (SCALAR)0.5 * (state->first + path->depth);
        path->weight = choose(ended, cos(half_gap) * exp(-middle), path->weight);
    }
    escape(path, ended);
    state->first = choose(marched, path->depth, state->first);
    state->interval = choose(marched, (real)0, state->interval);
    path->depth = choose(marched, (real)0, path->depth);
    state->second |= marched;
}
