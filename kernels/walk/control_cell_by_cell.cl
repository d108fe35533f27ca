/*---
title: A control and a majorant of the residual for each cell
uses: [walk/control_collide, walk/cell_by_cell]
state: {control: real}
---*/
static void enter_controlled_cell(Path *path, const Scene *scene, const mask entering)
{
    const real control = cell_control(path, scene);
    path->state.control = choose(entering, control, path->state.control);
}

/* As in walk/control_global.cl, cell by cell. */
static mask next_residual(Path *path, const Scene *scene, Rng *rng, mask *controlled)
{
    real draw = exponential(rng);
    mask walking = path->live;
    mask here = (mask)0;
    *controlled = (mask)0;
    enter_controlled_cell(path, scene, (mask)-1);
    for (;;) {
        const real plane = next_plane(path, scene);
        const mask inside = less(plane, path->ray.length);
        const real span = choose(inside, plane, path->ray.length) - path->t;
        const real residual = to_residual(path, draw, span), control = to_control(path, span);
        const mask found = walking & less(residual, control);
        const mask stopped = walking & ~found & less(control, (real)FAR);
        const mask crossing = walking & inside & ~found & ~stopped;
        const real nearer = smaller(residual, control);
        const real way = smaller(nearer, span);
        path->control_flown = choose(walking, path->control_flown + path->state.control * way, path->control_flown);
        path->t = choose(crossing, plane, choose(walking, path->t + way, path->t));
        escape(path, walking & ~inside & ~found & ~stopped);
        here |= found;
        *controlled |= stopped;
        walking = crossing;
        if (!any_lane(walking))
            return here;
        /* Never below 0, as rounding may have it: such a draw would collide with a majorant of 0. */
        const real passed = path->majorant * span;
        const real left = draw - passed;
        draw = choose(crossing, larger(left, (real)0), draw);
        enter_next_cell(path, scene, plane, crossing);
        enter_controlled_cell(path, scene, crossing);
    }
}
