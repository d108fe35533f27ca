/*---
title: One majorant for the whole medium
state: {}
---*/
static void walk_begin(Path *path, const Scene *scene)
{
    path->majorant = (real)scene->majorant.sigma_t;
    path->mean_free_path = choose(less((real)0, path->majorant), (SCALAR)1 / path->majorant, (real)FAR);
}

/* Every live lane goes on to its next tentative collision or leaves; returns those now at one. A majorant of 0
   leaves no optical depth that a draw could stay below, not even a draw of 0. */
static mask next_tentative(Path *path, const Scene *scene, Rng *rng)
{
    const real draw = exponential(rng);
    const mask here = path->live & less(draw, path->majorant * (path->ray.length - path->t));
    path->t = choose(here, path->t + draw * path->mean_free_path, path->t);
    escape(path, path->live & ~here);
    return here;
}

/* Live lanes are put where the majorant's optical depth from the start is `depth`, or at the end of the ray. */
static void place_at_depth(Path *path, const Scene *scene, const real depth)
{
    const real t = depth * path->mean_free_path;
    path->t = choose(path->live, smaller(t, path->ray.length), path->t);
}

/* The majorant's optical depth of the whole ray. */
static real majorant_depth(Path *path, const Scene *scene) { return path->majorant * path->ray.length; }

/* That from here on, which is what the next draw is held against. */
static real majorant_depth_ahead(const Path *path, const Scene *scene, const real whole, const mask where)
{
    return path->majorant * (path->ray.length - path->t);
}
