/*---
title: A lane is on its path or on a shadow ray
state: {shadow: mask, waiting: mask, worth: real, held_rng: Rng}
---*/
/* A lane that collides flies a shadow ray next, and then goes on where it was: no other lane waits for it, and a
   step's lookup serves the lanes of both modes. hold_path and resume_path keep the path meanwhile. */

/* Lanes at the end of a flight wait until there are so many: scattering or facing the light costs as much for one as
   for all. */
#define TOGETHER ((LANES + 3) / 4)

static void flight_step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const mask flying = path->live & ~state->waiting;
    path->live = flying;
    path->steps += state->waiting;
    Rng drawn = *rng; /* a lane that waits draws no numbers */
    const mask here = next_tentative(path, scene, &drawn);
    const real sigma = sigma_t_at_tentative(path, scene, here);
    Rng apart = drawn;
    flight_at_tentative(path, scene, &drawn, here & ~state->shadow, sigma);
    shadow_at_tentative(path, scene, &apart, here & state->shadow, sigma);
    take_rng(&drawn, &apart, state->shadow);
    take_rng(rng, &drawn, flying);
    /* who leaves has nothing to wait for, and who is cut off no time */
    const mask hurry = (path->escaped & ~state->shadow) | ~less(path->steps, (index)SHADOW_STEPS);
    const mask ended = state->waiting | (flying & ~path->live & ~hurry);
    const mask enough = lane_count(ended) >= TOGETHER || !any_lane(path->live) ? (mask)-1 : (mask)0;
    state->waiting = ended & ~enough;
    path->live |= state->waiting;
}

/* Lanes `here` have collided; those that may scatter fly towards the light. */
static void begin_shadow(Path *path, const Scene *scene, Rng *rng, const mask here)
{
    const mask lit = scatters(path, scene, here);
    if (!any_lane(lit))
        return;
    hold_path(path, lit);
    take_rng(&path->state.held_rng, rng, lit);
    Path shadow;
    Rng shadow_rng;
    const real worth = face_light(path, scene, rng, &shadow, &shadow_rng, lit);
    take_ray(&path->ray, &shadow.ray, lit);
    take_flight(path, &shadow, lit);
    take_rng(rng, &shadow_rng, lit);
    path->state.worth = choose(lit, worth, path->state.worth);
    path->state.shadow |= lit;
}

/* Lanes `where` are at their collision again, with the weights that they had there. */
static void return_to_path(Path *path, const mask where)
{
    if (!any_lane(where))
        return;
    resume_path(path, where);
    path->escaped &= ~where;
    path->state.shadow &= ~where;
}

/* Lanes `seen` are at the end of a shadow ray: they collect its light, and scatter where they began it. */
static void end_shadow(Path *path, const Scene *scene, Rng *rng, const mask seen)
{
    if (!any_lane(seen))
        return;
    const Path shadow = *path;
    return_to_path(path, seen);
    collect_light(path, scene, &shadow, shadow.state.worth, seen);
    Rng next = path->state.held_rng;
    scatter(path, scene, &next, goes_on(path, scene, seen));
    take_rng(rng, &next, seen);
}
