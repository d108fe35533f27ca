/*---
title: Telescoping debiased ray marching
estimands: [transmittance]
needs: []
parameters:
  steps: {default: 8, minimum: 1, maximum: 100000, meaning: steps of the coarsest march}
  ratio:
    default: 0.2
    above: 0.015625
    below: 0.5
    meaning: >-
      chance of each further doubling; below 1/64 (1/16 where the extinction jumps), how the variance of the
      corrections falls, that of the estimate is infinite, above 1/2 the cost is
state:
  finest: real
  chance: real
  coarsest: mask
  step: real
  second: mask
  aside: mask
  depth_aside: real
citation: >-
  Misso, Bitterli, Georgiev, Jarosz 2022, Unbiased and consistent rendering using biased estimators; Giles, Szpruch
  2014, Antithetic multilevel Monte Carlo estimation (of the antithetic differences)
---*/
/* T = I_0 + (I_(j+1) - I_j) / p_j, a telescoping sum of which one random term is taken: I_j marches through
   steps x 2^j jittered intervals. One march serves both parts of a difference: of each two of its intervals a
   coin gives one to a coarser march and the other to a second one, which is set aside. I_j is the mean of these
   two, and what is linear in their deviation cancels in the difference. One lookup a step. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    /* Geometric: level j has the chance (1 - ratio) ratio^j. */
    const real level = floor(exponential(rng) / -log(scene->tracker.ratio));
    path->state.finest = scene->tracker.steps * exp2(level + (SCALAR)1);
    path->state.chance = ((SCALAR)1 - scene->tracker.ratio) * exp(level * log(scene->tracker.ratio));
    path->state.coarsest = (mask)-1;
    path->state.second = path->state.aside = (mask)0;
    path->state.step = path->state.depth_aside = path->weight = (real)0;
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const real intervals = choose(state->coarsest, (real)scene->tracker.steps, state->finest);
    const real length = path->ray.length / intervals;
    const real sigma = sigma_t(path, scene, (state->step + uniform(rng)) * length, path->live);
    const mask coin = less(uniform(rng), (real)(SCALAR)0.5);
    state->aside = ~state->coarsest & choose(state->second, ~state->aside, coin);
    path->depth = choose(path->live & ~state->aside, path->depth + sigma * length, path->depth);
    state->depth_aside = choose(path->live & state->aside, state->depth_aside + sigma * length, state->depth_aside);
    state->step = choose(path->live, state->step + 1, state->step);
    state->second = ~state->second & ~state->coarsest;
    const mask ended = path->live & ~less(state->step, intervals);
    if (any_lane(ended)) {
        const real fine = exp(-path->depth - state->depth_aside);
        const real one = exp(-2 * path->depth), other = exp(-2 * state->depth_aside);
        const real correction = (fine - (SCALAR)0.5 * (one + other)) / state->chance;
        splat(path, choose(state->coarsest, fine, correction), path->ray.length, (mask)-1, ended);
        escape(path, ended & ~state->coarsest);
        path->depth = choose(ended, (real)0, path->depth);
        state->step = choose(ended, (real)0, state->step);
        state->coarsest &= ~ended;
    }
}
