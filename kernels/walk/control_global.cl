/*---
title: One control and one majorant of the residual for the whole medium
uses: [walk/control_collide]
state: {control: real}
---*/
static void walk_begin(Path *path, const Scene *scene)
{
    path->state.control = (real)scene->majorant.control;
    path->majorant = (real)scene->majorant.residual;
    path->mean_free_path = choose(less((real)0, path->majorant), (SCALAR)1 / path->majorant, (real)FAR);
}

/* Every live lane goes on to its next tentative collision with the residual, to its collision with the
   control, or leaves. Returns the lanes at the first; `controlled` are those at the second. The control's
   optical depth is accumulated in path->control_flown, and collides where that reaches path->target. */
static mask next_residual(Path *path, const Scene *scene, Rng *rng, mask *controlled)
{
    const real draw = exponential(rng);
    const real rest = path->ray.length - path->t;
    const real residual = to_residual(path, draw, rest), control = to_control(path, rest);
    const real nearer = smaller(residual, control);
    const real way = smaller(nearer, rest);
    const mask here = path->live & less(residual, control);
    *controlled = path->live & ~here & less(control, (real)FAR);
    path->t = choose(path->live, path->t + way, path->t);
    path->control_flown = choose(path->live, path->control_flown + path->state.control * way, path->control_flown);
    escape(path, path->live & ~here & ~*controlled);
    return here;
}
