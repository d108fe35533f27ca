/*---
title: Unbiased ray marching
estimands: [transmittance]
needs: [majorant]
uses: [math/symmetric_means]
state:
  order: real
  comb: real
  tooth: real
  teeth: real
  offset: real
  estimates: real[16]
citation: >-
  Kettunen, d'Eon, Pantaleoni, Novak 2021, An unbiased ray-marching transmittance estimator
  (algorithm 1, without endpoint matching)
---*/
/* Optical depths X_i, each marched with a comb of equal steps at a random offset, enter a power series of
   exp(-X) about each of them in turn. Its order N is drawn by Bhanot-Kennedy roulette: p_k, the chance that
   it is k or more, is 0.9 for k = 1 and 2 and 2 / k times the one before for the others. So k! p_k is
   0.9 x 2^(k - 1). One uniform of 24 bits draws N, which is at most 14: more has a chance below 6e-8. */
#define MOST_COMBS 16
#define EXPANDED ((SCALAR)0.9)

static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    const real depth = majorant_depth(path, scene);
    path->state.teeth = ceil(cbrt(((SCALAR)0.015 + depth) * ((SCALAR)0.65 + depth) * ((SCALAR)60.3 + depth)));
    const real u = uniform(rng);
    SCALAR chance = EXPANDED;
    path->state.order = path->state.comb = path->state.tooth = (real)0;
    for (int k = 1; k < MOST_COMBS; chance *= (SCALAR)2 / ++k)
        path->state.order -= to_real(less(u, (real)chance));
}

/* The mean over the pivots j of exp(-X_j) sum over k of m_k / (k! p_k): m_k is the mean of the products of k
   of the differences X_j - X_i. */
static real transmittance_of(const State *state, const mask where)
{
    real total = (real)0;
    for (int j = 0; j < MOST_COMBS && any_lane(where & ~less(state->order, (real)(SCALAR)j)); ++j) {
        real means[MOST_COMBS] = {(real)1}, sum = (real)1;
        for (int i = 0, joined = 0; i < MOST_COMBS; ++i) {
            const mask used = where & ~less(state->order, (real)(SCALAR)i);
            if (i != j && any_lane(used))
                symmetric_means_join(means, ++joined, state->estimates[j] - state->estimates[i], used);
        }
        SCALAR share = (SCALAR)1 / EXPANDED;
        for (int k = 1; k < MOST_COMBS; ++k, share *= (SCALAR)0.5)
            sum += means[k] * share;
        total += choose(less(state->order, (real)(SCALAR)j), (real)0, exp(-state->estimates[j]) * sum);
    }
    return total / (state->order + (SCALAR)1);
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const real u = uniform(rng);
    state->offset = choose(path->live & equal(state->tooth, (real)0), u, state->offset);
    const real length = path->ray.length / state->teeth;
    const real sigma = sigma_t(path, scene, (state->tooth + state->offset) * length, path->live);
    path->depth = choose(path->live, path->depth + sigma * length, path->depth);
    state->tooth = choose(path->live, state->tooth + 1, state->tooth);
    const mask marched = path->live & ~less(state->tooth, state->teeth);
    for (int i = 0; i < MOST_COMBS && any_lane(marched); ++i)
        state->estimates[i] = choose(marched & equal(state->comb, (real)(SCALAR)i), path->depth, state->estimates[i]);
    state->comb = choose(marched, state->comb + 1, state->comb);
    state->tooth = choose(marched, (real)0, state->tooth);
    path->depth = choose(marched, (real)0, path->depth);
    const mask last = marched & less(state->order, state->comb);
    if (any_lane(last))
        path->weight = choose(last, transmittance_of(state, last), path->weight);
    escape(path, last);
}
