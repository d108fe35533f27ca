/*---
title: Regular tracking
estimands: [transmittance, free_path, radiance, path_length]
needs: [cells]
citation: >-
  Amanatides, Woo 1987, A fast voxel traversal algorithm; Sutton, Brown, Bjorkman et al. 1999 (of the cells' exact
  integral)
---*/
/* One cell of the medium a step: its optical depth is exact, and so is the distance at which the sampled
   depth is reached within it. As an estimate of transmittance it is exp(-tau), exactly. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    path->target = sampled_depth(rng);
    cells_begin(path, scene);
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const real t_exit = cell_exit(path, scene);
    const Cell cell = cell_between(path, scene, path->t, t_exit, path->live);
    const real depth = path->depth + cell_depth(cell, t_exit - path->t);
    const mask here = path->live & less(path->target, depth);
    if (any_lane(here))
        path->t = choose(here, path->t + cell_distance(cell, path->target - path->depth, t_exit - path->t), path->t);
    collide(path, here);
    path->depth = choose(path->live, depth, path->depth);
    path->t = choose(path->live, t_exit, path->t);
    const mask leaving = path->live & ~less(t_exit, path->ray.length);
    escape_through_depth(path, leaving);
    cell_cross(path, path->live);
}
