/*---
title: Tentative collisions cell by cell
uses: [walk/cell_by_cell]
---*/
/* Every live lane flies on through so much of the majorant's optical depth or leaves; returns those that are
   there. They wait for the others: in thin media that was 1.4 times as fast as one cell a step. */
static mask fly_through(Path *path, const Scene *scene, const real whole_draw)
{
    real draw = whole_draw;
    mask walking = path->live;
    mask here = (mask)0;
    for (;;) {
        const real plane = next_plane(path, scene);
        const mask inside = less(plane, path->ray.length);
        const real depth = path->majorant * (choose(inside, plane, path->ray.length) - path->t);
        const mask found = walking & less(draw, depth);
        const mask crossing = walking & inside & ~found;
        escape(path, walking & ~inside & ~found);
        path->t = choose(found, path->t + draw * path->mean_free_path, choose(crossing, plane, path->t));
        here |= found;
        walking = crossing;
        if (!any_lane(walking))
            break;
        /* Never below 0, as rounding may have it: such a draw would collide with a majorant of 0. */
        const real left = draw - depth;
        draw = choose(crossing, larger(left, (real)0), draw);
        enter_next_cell(path, scene, plane, crossing);
    }
    path->majorant_flown = choose(here, path->majorant_flown + whole_draw, path->majorant_flown);
    return here;
}

/* Every live lane goes on to its next tentative collision or leaves; returns those now at one. */
static mask next_tentative(Path *path, const Scene *scene, Rng *rng)
{
    return fly_through(path, scene, exponential(rng));
}

/* Live lanes are put where the majorant's optical depth from the start is `depth`, or at the end of the ray. */
static void place_at_depth(Path *path, const Scene *scene, const real depth)
{
    Path probe = *path;
    probe.t = (real)0;
    walk_begin(&probe, scene);
    fly_through(&probe, scene, depth);
    path->t = choose(path->live, probe.t, path->t);
    path->majorant = probe.majorant;
    path->crossings = probe.crossings;
}

/* The majorant's optical depth that lanes `walking` of a probe have before them, or the first of it from `enough` on. */
static real walk_ahead(Path *probe, const Scene *scene, mask walking, const real enough)
{
    real depth = (real)0;
    while (any_lane(walking)) {
        const real plane = next_plane(probe, scene);
        const real t_exit = smaller(plane, probe->ray.length);
        depth = choose(walking, depth + probe->majorant * (t_exit - probe->t), depth);
        probe->t = choose(walking, t_exit, probe->t);
        walking &= less(plane, probe->ray.length) & less(depth, enough);
        enter_next_cell(probe, scene, plane, walking);
    }
    return depth;
}

/* The majorant's optical depth of the whole ray, by a walk through all of its cells. */
static real majorant_depth(Path *path, const Scene *scene)
{
    Path probe = *path;
    const real depth = walk_ahead(&probe, scene, (mask)-1, (real)FAR);
    path->crossings = probe.crossings;
    return depth;
}

/* That from here on. What was flown adds up with a rounding a collision, of a part in 2^24 of the whole; where
   that tells, the last of the ray is walked ahead instead, until nothing more comes through. */
#define MANY_ROUNDINGS 1024
#define BLACK 128
static real majorant_depth_ahead(Path *path, const Scene *scene, const real whole, const mask where)
{
    const real ahead = whole - path->majorant_flown;
    const mask walked = where & less((real)MANY_ROUNDINGS, whole) & less(ahead, (real)MANY_ROUNDINGS);
    if (!any_lane(walked))
        return ahead;
    Path probe = *path;
    const real depth = walk_ahead(&probe, scene, walked, (real)BLACK);
    path->crossings = probe.crossings;
    return choose(walked, depth, ahead);
}
