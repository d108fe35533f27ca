/*---
title: Jackknife transmittance, placed by moments of cells
estimands: [transmittance]
needs: [majorant, control]
majorants: [grid, octree]
unbiased: false
parameters:
  steps: {default: 8, minimum: 1, maximum: 100000, meaning: lookups of each of its two marches}
  placement:
    choices: [mean, second_moment]
    default: second_moment
    host: true
    meaning: >-
      what lookups of a cell are in proportion to, its mean extinction; or the root of the second moment of what is
      above its lowest extinction, which is the control
state:
  interval: real
  first: real
  flown: real
  whole: real
  controlled: real
  second: mask
like: jackknife
citation: Peters 2025, Jackknife transmittance and MIS weight estimation, ACM Transactions on Graphics 44 (6)
---*/
/* Intervals are equal in the depth of a density, path->majorant; a lookup counts what is above the control over it. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    State *state = &path->state;
    state->interval = state->first = state->flown = state->whole = state->controlled = (real)0;
    state->second = (mask)0;
    Path probe = *path;
    for (mask walking = (mask)-1; any_lane(walking);) {
        const real plane = next_plane(&probe, scene), t_exit = smaller(plane, probe.ray.length);
        const real span = choose(walking, t_exit - probe.t, (real)0);
        state->whole += probe.majorant * span;
        state->controlled += cell_control(&probe, scene) * span;
        walking &= less(plane, probe.ray.length);
        probe.t = choose(walking, plane, probe.t);
        enter_next_cell(&probe, scene, plane, walking);
    }
    path->depth = state->controlled;
    path->crossings = probe.crossings;
}

static void next_march(Path *path, const Scene *scene, const mask marched)
{
    const mask ended = marched & path->state.second;
    const real half_sum = (SCALAR)0.5 * (path->state.first + path->depth);
    path->weight = choose(ended, cos(half_sum - path->depth) * exp(-half_sum), path->weight);
    escape(path, ended);
    Path again = *path;
    again.t = again.state.interval = again.state.flown = (real)0;
    walk_begin(&again, scene);
    again.state.first = path->depth;
    again.depth = path->state.controlled;
    again.state.second = (mask)-1;
    take_flight(path, &again, marched & ~ended);
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const real share = state->whole / scene->tracker.steps, depth = (state->interval + uniform(rng)) * share;
    real draw = depth - state->flown;
    for (mask walking = path->live; any_lane(walking);) {
        const real plane = next_plane(path, scene), t_exit = smaller(plane, path->ray.length);
        const real passed = path->majorant * (t_exit - path->t);
        const real t = path->t + draw * path->mean_free_path, held = smaller(t, t_exit);
        path->t = choose(walking, held, path->t);
        walking &= less(plane, path->ray.length) & less(passed, draw);
        draw = choose(walking, draw - passed, draw);
        enter_next_cell(path, scene, plane, walking);
    }
    const mask counted = path->live & less((real)0, path->majorant);
    const real above = sigma_t(path, scene, path->t, path->live) - cell_control(path, scene);
    path->depth = choose(counted, path->depth + share * (above / path->majorant), path->depth);
    state->flown = choose(path->live, depth, state->flown);
    state->interval = choose(path->live, state->interval + 1, state->interval);
    const mask marched = path->live & ~less(state->interval, (real)scene->tracker.steps);
    if (any_lane(marched))
        next_march(path, scene, marched);
}
