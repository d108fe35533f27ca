/*---
title: Ray marching that skips empty cells and stops in the dark
estimands: [transmittance, free_path, radiance, path_length]
needs: [majorant]
majorants: [grid, octree]
unbiased: false
parameters:
  step: {unit: length, default: 0.01, above: 0, meaning: length of a step}
  stop: {default: 0.001, minimum: 0, below: 1, meaning: transmittance below which a ray ends as if it were 0}
state:
  taken: real
  offset: real
like: march
citation: Fong, Wrenninge, Kulla, Habel 2017, Production volume rendering, SIGGRAPH course
---*/
/* The steps of march, looked up at one random place for all steps of a ray. No step is looked up in a cell whose
   majorant is 0: what lies in such cells is stepped over. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    path->target = sampled_depth(rng);
    path->state.taken = (real)0;
    path->state.offset = uniform(rng);
    walk_begin(path, scene);
}

static real place_of(const Path *path, const Scene *scene, const real taken, real *width)
{
    const real start = taken * scene->tracker.step, rest = path->ray.length - start;
    *width = smaller(rest, (real)scene->tracker.step);
    return start + path->state.offset * *width;
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const SCALAR step = scene->tracker.step, black = scene->tracker.stop > (SCALAR)0 ? -log(scene->tracker.stop) : FAR;
    real width;
    mask found = (mask)0;
    for (mask walking = path->live; any_lane(walking);) {
        const real plane = next_plane(path, scene), place = place_of(path, scene, state->taken, &width);
        const mask inside = less(plane, path->ray.length), ahead = inside & ~less(place, plane);
        found |= walking & ~ahead & less((real)0, path->majorant);
        /* the first step from the end of an empty cell on; the last step of a ray is shorter */
        const real past = ceil(plane / step - state->offset), next = larger(past, state->taken);
        const real on = next - to_real(less(place_of(path, scene, next, &width), plane));
        const mask over = walking & ~found & ~ahead;
        const mask gone = over & ~(inside & less(on * step, path->ray.length));
        const mask crossing = walking & ~found & ~gone;
        state->taken = choose(over, on, state->taken);
        path->t = choose(crossing, plane, path->t);
        escape_through_depth(path, gone);
        enter_next_cell(path, scene, plane, crossing);
        walking = crossing;
    }
    const real place = place_of(path, scene, state->taken, &width), start = state->taken * step;
    const real sigma = sigma_t(path, scene, place, found), depth = path->depth + sigma * width;
    const mask here = found & less(path->target, depth), dark = found & less(black, depth);
    path->t = choose(here, start + (path->target - path->depth) / sigma, choose(found, start, path->t));
    collide(path, here | dark);
    path->depth = choose(found, depth, path->depth);
    state->taken = choose(found, state->taken + 1, state->taken);
    escape_through_depth(path, found & path->live & ~less(state->taken * step, path->ray.length));
}
