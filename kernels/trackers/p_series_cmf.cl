/*---
title: p-series with cumulative mass function
estimands: [transmittance]
needs: [majorant]
parameters:
  mass:
    default: 0.99
    minimum: 0
    below: 1
    meaning: share of the Poisson mass whose terms are all evaluated, before Russian roulette
state: {total: real, term: real, log_mass: real, summed: real}
citation: >-
  Georgiev, Misso, Hachisuka, Nowrouzezahrai, Krivanek, Jarosz 2019, Integral formulations of volumetric
  transmittance (section 5)
---*/
/* T = sum over k of p_k E[w_1 ... w_k], with the Poisson probabilities p_k of the majorant's optical depth and
   w = 1 - sigma_t / majorant at random points, uniform in that depth. The same points serve all terms, so the
   first ones are summed outright; what is beyond the mass continues with the probability p_k / p_(k-1). */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    path->state.total = majorant_depth(path, scene);
    path->state.log_mass = -path->state.total;
    path->state.term = (real)1;
    path->state.summed = exp(-path->state.total);
    path->weight = (real)0;
    splat(path, exp(-path->state.total), path->ray.length, (mask)-1, (mask)-1);
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const real order = to_real(path->steps);
    const real ratio = state->total / order;
    const mask roulette = ~less(state->summed, (real)scene->tracker.mass);
    const mask stopped = path->live & ((roulette & ~less(uniform(rng), ratio)) | equal(ratio, (real)0));
    place_at_depth(path, scene, uniform(rng) * state->total);
    escape(path, stopped);
    const mask here = path->live;
    const real sigma = sigma_t_at_tentative(path, scene, here);
    const mask empty = equal(path->majorant, (real)0); /* a last cell, by rounding */
    const real null = choose(empty, (real)1, (path->majorant - sigma) / path->majorant);
    state->term = choose(here, state->term * null, state->term);
    /* Past the mode a survivor keeps the mass of its predecessor; the probability has paid for the rest. */
    const mask grows = here & (~roulette | less((real)1, ratio));
    state->log_mass = choose(grows, state->log_mass + log(ratio), state->log_mass);
    const real mass = exp(state->log_mass);
    state->summed = choose(here, state->summed + mass, state->summed);
    splat(path, mass * state->term, path->ray.length, (mask)-1, here);
}
