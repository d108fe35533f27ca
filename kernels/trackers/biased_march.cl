/*---
title: Biased ray marching by one comb
estimands: [transmittance]
needs: [majorant]
unbiased: false
parameters:
  ends:
    choices: [free, matched]
    default: matched
    meaning: whether what the comb is off by where the ray's ends differ is taken off, by a lookup at each of them
state:
  tooth: real
  teeth: real
  offset: real
  rise: real
like: unbiased_march
citation: >-
  Kettunen, d'Eon, Pantaleoni, Novak 2021, An unbiased ray-marching transmittance estimator (its biased variant, and
  endpoint matching)
---*/
/* The order 0 of unbiased marching: exp(-X) of one comb with as many teeth, and nothing that takes the bias off. With
   matched ends X is that of the extinction less a line from one end to the other, plus what the line has: for a smooth
   medium its standard deviation falls with the square of the step, not with the step. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    const real depth = majorant_depth(path, scene);
    path->state.teeth = ceil(cbrt(((SCALAR)0.015 + depth) * ((SCALAR)0.65 + depth) * ((SCALAR)60.3 + depth)));
    path->state.tooth = path->state.rise = (real)0;
    path->state.offset = uniform(rng);
#if ENDS == ENDS_MATCHED
    const real first = sigma_t(path, scene, (real)0, (mask)-1), last = sigma_t(path, scene, path->ray.length, (mask)-1);
    path->state.rise = last - first;
#endif
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const real length = path->ray.length / state->teeth;
    const real sigma = sigma_t(path, scene, (state->tooth + state->offset) * length, path->live);
    path->depth = choose(path->live, path->depth + sigma * length, path->depth);
    state->tooth = choose(path->live, state->tooth + 1, state->tooth);
    const mask ended = path->live & ~less(state->tooth, state->teeth);
    if (any_lane(ended)) {
        const real tilt = (state->offset - (SCALAR)0.5) * length * state->rise;
        path->weight = choose(ended, exp(tilt - path->depth), path->weight);
    }
    escape(path, ended);
}
