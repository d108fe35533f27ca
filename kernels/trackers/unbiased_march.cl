/*---
title: Unbiased ray marching
estimands: [transmittance]
needs: [majorant]
state:
  order: real
  comb: real
  tooth: real
  teeth: real
  offset: real
  sum: real
  estimates: real[16]
citation: >-
  Kettunen, d'Eon, Pantaleoni, Novak 2021, An unbiased ray-marching transmittance estimator, algorithm 1
  (without endpoint matching)
---*/
/* Optical depths X_i, each marched with a comb of equal steps at a random offset, enter a power series of
   exp(-X) about each of them in turn. Its order N is drawn by Bhanot-Kennedy roulette: at least 2 with the
   chance 0.9, and every further term k with the chance 2 / k. One uniform of 24 bits draws it, so N is at
   most 14; what lies beyond has a chance below 6e-8. */
#define MOST_COMBS 16
#define AT_LEAST_TWO ((SCALAR)0.9)

static SCALAR chance_of_order(const int k)
{
    SCALAR chance = k == 0 ? (SCALAR)1 : AT_LEAST_TWO;
    for (int i = 3; i <= k; ++i)
        chance *= (SCALAR)2 / i;
    return chance;
}

static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    State *state = &path->state;
    const real u = uniform(rng);
    state->order = (real)0;
    for (int k = 1; k < MOST_COMBS; ++k)
        state->order -= to_real(less(u, (real)chance_of_order(k)));
    const real depth = majorant_depth(path, scene);
    const real cube = ((SCALAR)0.015 + depth) * ((SCALAR)0.65 + depth) * ((SCALAR)60.3 + depth);
    state->teeth = ceil(cbrt(cube));
    state->comb = state->tooth = state->sum = (real)0;
}

/* The mean of the products of k of the differences X_j - X_i, for k up to the order, summed into the series. */
static real series_about(const State *state, const int pivot, const int most)
{
    real symmetric[MOST_COMBS];
    for (int k = 0; k < MOST_COMBS; ++k)
        symmetric[k] = (real)(SCALAR)(k == 0);
    for (int i = 0; i <= most; ++i) {
        const mask used = ~less(state->order, (real)(SCALAR)i);
        const real difference = choose(used, state->estimates[pivot] - state->estimates[i], (real)0);
        for (int k = most; k >= 1; --k)
            symmetric[k] += symmetric[k - 1] * difference;
    }
    real sum = (real)1, binomial = (real)1;
    SCALAR factorial = 1;
    for (int k = 1; k <= most; ++k) {
        binomial *= (state->order - (SCALAR)(k - 1)) / (SCALAR)k;
        factorial *= k;
        const mask within = ~less(state->order, (real)(SCALAR)k);
        const real term = symmetric[k] / (binomial * factorial * chance_of_order(k));
        sum += choose(within, term, (real)0);
    }
    return sum;
}

static real transmittance_of(const State *state, const mask where)
{
    int most = 0;
    while (most < MOST_COMBS - 1 && any_lane(where & less((real)(SCALAR)most, state->order)))
        ++most;
    real total = (real)0;
    for (int pivot = 0; pivot <= most; ++pivot) {
        const real value = exp(-state->estimates[pivot]) * series_about(state, pivot, most);
        total += choose(less(state->order, (real)(SCALAR)pivot), (real)0, value);
    }
    return total / (state->order + (SCALAR)1);
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const real u = uniform(rng);
    state->offset = choose(path->live & equal(state->tooth, (real)0), u, state->offset);
    const real length = path->length / state->teeth;
    const real sigma = sigma_t(path, scene, (state->tooth + state->offset) * length, path->live);
    state->sum = choose(path->live, state->sum + sigma * length, state->sum);
    state->tooth = choose(path->live, state->tooth + 1, state->tooth);
    const mask marched = path->live & ~less(state->tooth, state->teeth);
    if (!any_lane(marched))
        return;
    for (int i = 0; i < MOST_COMBS; ++i)
        state->estimates[i] = choose(marched & equal(state->comb, (real)(SCALAR)i), state->sum, state->estimates[i]);
    state->comb = choose(marched, state->comb + 1, state->comb);
    state->tooth = choose(marched, (real)0, state->tooth);
    state->sum = choose(marched, (real)0, state->sum);
    const mask last = marched & less(state->order, state->comb);
    if (any_lane(last)) {
        path->weight = choose(last, transmittance_of(state, last), path->weight);
        escape(path, last);
    }
}
