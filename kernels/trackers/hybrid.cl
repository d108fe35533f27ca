/*---
title: Delta tracking where it pays, else cell by cell
estimands: [transmittance, free_path, radiance, path_length]
needs: [majorant, cells]
majorants: [global]
bounding: true
parameters:
  threshold:
    default: 0.1
    minimum: 0
    maximum: 2
    meaning: >-
      extinction over majorant below which it goes on cell by cell; 0 is delta tracking, above 1 regular tracking
state:
  by_cells: mask
  cells_from: real
like: delta
citation: >-
  Leppanen 2010, Performance of Woodcock delta-tracking in lattice physics applications using the Serpent Monte
  Carlo reactor physics burnup calculation code
---*/
/* A null collision where the extinction is below the threshold begins a walk through the cells, each passed with its
   exact optical depth; a cell above the threshold ends it. The cells that delta tracking has flown over are crossed
   without a lookup. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    path->target = sampled_depth(rng);
    path->state.by_cells = less((real)1, (real)scene->tracker.threshold);
    path->state.cells_from = (real)0;
    walk_begin(path, scene);
    cells_begin(path, scene);
}

static void catch_up(Path *path, const Scene *scene, const mask where)
{
    Path probe = *path;
    probe.t = choose(where, path->state.cells_from, path->t);
    for (mask behind = where; any_lane(behind);) {
        const real t_exit = cell_exit(&probe, scene);
        behind &= less(probe.t, path->t) & ~less(path->t, t_exit);
        probe.t = choose(behind, t_exit, probe.t);
        cell_cross(&probe, behind);
    }
    path->state = probe.state;
    path->crossings = probe.crossings;
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const mask walking = path->live & state->by_cells, flying = path->live & ~walking;
    const SCALAR threshold = scene->tracker.threshold;
    path->live = flying;
    const mask here = next_tentative(path, scene, rng);
    const real sigma = sigma_t_at_tentative(path, scene, here);
    escape_through_depth(path, flying & ~path->live);
    collide(path, here & less(uniform(rng) * path->majorant, sigma));
    const mask thin = here & path->live & less(sigma, threshold * path->majorant);
    path->live |= walking;
    if (any_lane(walking)) {
        const real t_exit = cell_exit(path, scene), span = t_exit - path->t;
        const Cell cell = cell_between(path, scene, path->t, t_exit, walking);
        const real passed = cell_depth(cell, span), depth = path->depth + passed;
        const mask thick = walking & less(threshold * path->majorant * span, passed);
        const mask through = walking & ~thick, collided = through & less(path->target, depth);
        if (any_lane(collided))
            path->t = choose(collided, path->t + cell_distance(cell, path->target - path->depth, span), path->t);
        collide(path, collided);
        path->depth = choose(through, depth, path->depth);
        path->t = choose(through & ~collided, t_exit, path->t);
        state->cells_from = choose(walking, path->t, state->cells_from);
        escape_through_depth(path, through & path->live & ~less(t_exit, path->ray.length));
        cell_cross(path, through & path->live);
        state->by_cells &= ~thick;
    }
    catch_up(path, scene, thin);
    state->by_cells |= thin;
}
