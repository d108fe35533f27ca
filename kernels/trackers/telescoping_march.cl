/*---
title: Telescoping debiased ray marching
estimands: [transmittance]
needs: []
parameters:
  steps: {default: 4, minimum: 1, maximum: 100000, meaning: steps of the coarsest march}
  ratio:
    default: 0.3
    above: 0.125
    below: 0.5
    meaning: >-
      chance of each further doubling; below 1/8, how the variance of a jittered march falls, the variance
      is infinite, above 1/2 the cost is
state:
  level: real
  chance: real
  stage: real
  step: real
citation: Misso, Bitterli, Georgiev, Jarosz 2022, Unbiased and consistent rendering using biased estimators
---*/
/* T = I_0 + (I_(j+1) - I_j) / p_j, a telescoping sum of which one random term is taken: I_j marches through
   steps x 2^j jittered intervals. Three marches a sample, one lookup a step: the coarsest, then levels j and
   j + 1. */
static real intervals_of(const Path *path, const Scene *scene)
{
    const mask coarsest = equal(path->state.stage, (real)0);
    const real level = choose(coarsest, (real)0, path->state.level + path->state.stage - (SCALAR)1);
    return scene->tracker.steps * exp2(level);
}

static void begin(Path *path, const Scene *scene, Rng *rng)
{
    /* Geometric: level j has the chance (1 - ratio) ratio^j. */
    const real level = floor(exponential(rng) / -log(scene->tracker.ratio));
    path->state.level = level;
    path->state.chance = ((SCALAR)1 - scene->tracker.ratio) * exp(level * log(scene->tracker.ratio));
    path->state.stage = path->state.step = (real)0;
    path->weight = (real)0;
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const real intervals = intervals_of(path, scene);
    const real length = path->length / intervals;
    const real t = (state->step + uniform(rng)) * length;
    const real sigma = sigma_t(path, scene, t, path->live);
    path->depth = choose(path->live, path->depth + sigma * length, path->depth);
    state->step = choose(path->live, state->step + 1, state->step);
    const mask ended = path->live & ~less(state->step, intervals);
    if (any_lane(ended)) {
        const mask coarsest = equal(state->stage, (real)0), last = equal(state->stage, (real)2);
        const real factor = choose(coarsest, (real)1, choose(last, (SCALAR)1 / state->chance, (SCALAR)-1 / state->chance));
        deposit(path, factor * exp(-path->depth), path->length, (mask)-1, ended);
        path->depth = choose(ended, (real)0, path->depth);
        state->step = choose(ended, (real)0, state->step);
        state->stage = choose(ended, state->stage + 1, state->stage);
        escape(path, ended & last);
    }
}
