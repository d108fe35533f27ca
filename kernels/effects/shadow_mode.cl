/*---
title: A lane is on its path or on a shadow ray
state:
  shadow: mask
  waiting: mask
  worth: real
  held_weight: spectrum
  held_collected: spectrum
  held_origin_x: real
  held_origin_y: real
  held_origin_z: real
  held_direction_x: real
  held_direction_y: real
  held_direction_z: real
  held_length: real
  held_t: real
  held_rng: bits[4]
---*/
/* A lane that collides flies a shadow ray next, and then goes on where it was: no other lane waits for it, and a
   step's lookup serves the lanes of both modes. */
#undef next_tentative
#undef sigma_t_at_tentative

static void merge_rng(Rng *into, const Rng *from, const mask where)
{
    const bits_mask narrow = narrow_mask(where);
    into->s0 = choose(narrow, from->s0, into->s0);
    into->s1 = choose(narrow, from->s1, into->s1);
    into->s2 = choose(narrow, from->s2, into->s2);
    into->s3 = choose(narrow, from->s3, into->s3);
}

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
    path_step(path, scene, &drawn, here & ~state->shadow, sigma);
    shadow_step(path, scene, &apart, here & state->shadow, sigma);
    merge_rng(&drawn, &apart, state->shadow);
    merge_rng(rng, &drawn, flying);
    /* who leaves has nothing to wait for, and who is cut off no time */
    const mask hurry = (path->escaped & ~state->shadow) | ~less(path->steps, (index)SHADOW_STEPS);
    const mask ended = state->waiting | (flying & ~path->live & ~hurry);
    const mask enough = lane_count(ended) >= TOGETHER || !any_lane(path->live) ? (mask)-1 : (mask)0;
    state->waiting = ended & ~enough;
    path->live |= state->waiting;
}

/* What lanes `where` draw next on their paths; a shadow ray has a stream of its own. */
static void hold_rng(Path *path, const Rng *rng, const mask where)
{
    bits *held = path->state.held_rng;
    const bits_mask narrow = narrow_mask(where);
    held[0] = choose(narrow, rng->s0, held[0]);
    held[1] = choose(narrow, rng->s1, held[1]);
    held[2] = choose(narrow, rng->s2, held[2]);
    held[3] = choose(narrow, rng->s3, held[3]);
}

/* Lanes `where` take over what a ray is and what flies on it. */
static void take_over(Path *path, const Path *next, const mask where)
{
    path->origin_x = choose(where, next->origin_x, path->origin_x);
    path->origin_y = choose(where, next->origin_y, path->origin_y);
    path->origin_z = choose(where, next->origin_z, path->origin_z);
    path->direction_x = choose(where, next->direction_x, path->direction_x);
    path->direction_y = choose(where, next->direction_y, path->direction_y);
    path->direction_z = choose(where, next->direction_z, path->direction_z);
    path->length = choose(where, next->length, path->length);
    path->t = choose(where, next->t, path->t);
    path->depth = choose(where, next->depth, path->depth);
    path->target = choose(where, next->target, path->target);
    path->majorant = choose(where, next->majorant, path->majorant);
    path->mean_free_path = choose(where, next->mean_free_path, path->mean_free_path);
    path->weight = choose(where, next->weight, path->weight);
    path->escaped = choose(where, next->escaped, path->escaped);
    path->lookups = choose(where, next->lookups, path->lookups);
    path->crossings = choose(where, next->crossings, path->crossings);
    path->violations = choose(where, next->violations, path->violations);
    merge_state(&path->state, &next->state, where);
}

static void hold_path(Path *path, const mask where)
{
    State *held = &path->state;
    held->held_origin_x = choose(where, path->origin_x, held->held_origin_x);
    held->held_origin_y = choose(where, path->origin_y, held->held_origin_y);
    held->held_origin_z = choose(where, path->origin_z, held->held_origin_z);
    held->held_direction_x = choose(where, path->direction_x, held->held_direction_x);
    held->held_direction_y = choose(where, path->direction_y, held->held_direction_y);
    held->held_direction_z = choose(where, path->direction_z, held->held_direction_z);
    held->held_length = choose(where, path->length, held->held_length);
    held->held_t = choose(where, path->t, held->held_t);
    for (int c = 0; c < CHANNELS; ++c) {
        held->held_weight[c] = choose(where, weight_of(path, c), held->held_weight[c]);
        held->held_collected[c] = choose(where, score_of(path, c), held->held_collected[c]);
    }
}

/* Lanes `where` are at their collision again, with the weights that they had there. */
static void resume_path(Path *path, const mask where)
{
    if (!any_lane(where))
        return;
    Path held = *path;
    held.origin_x = path->state.held_origin_x;
    held.origin_y = path->state.held_origin_y;
    held.origin_z = path->state.held_origin_z;
    held.direction_x = path->state.held_direction_x;
    held.direction_y = path->state.held_direction_y;
    held.direction_z = path->state.held_direction_z;
    held.length = path->state.held_length;
    held.t = path->state.held_t;
    held.weight = (real)1;
    held.escaped = (mask)0;
    held.state.shadow = (mask)0;
    channels_begin(&held);
    for (int c = 0; c < CHANNELS; ++c) {
        tint(&held, c, path->state.held_weight[c], where);
        collect(&held, c, path->state.held_collected[c], where);
    }
    take_over(path, &held, where);
}

/* Lanes `here` have collided; those that may scatter fly towards the light. */
static void begin_shadow(Path *path, const Scene *scene, Rng *rng, const mask here)
{
    const mask lit = here & less(path->state.scatterings, (index)(INTEGER)scene->optics.scatterings);
    if (!any_lane(lit))
        return;
    hold_path(path, lit);
    hold_rng(path, rng, lit);
    Path shadow = *path;
    shadow.state.worth = face_light(path, scene, &shadow, lit);
    shadow.state.shadow = (mask)-1;
    Rng shadow_rng = companion(rng);
    shadow_begin(&shadow, scene, &shadow_rng);
    take_over(path, &shadow, lit);
    merge_rng(rng, &shadow_rng, lit);
    path->live |= lit;
}

/* Lanes `seen` are at the end of a shadow ray: they collect its light, and scatter where they began it. */
static void end_shadow(Path *path, const Scene *scene, Rng *rng, const mask seen)
{
    if (!any_lane(seen))
        return;
    const Path shadow = *path;
    resume_path(path, seen);
    for (int c = 0; c < CHANNELS; ++c) {
        const real light = transmittance_of_shadow(&shadow, c);
        const SCALAR power = scene->optics.albedo[c] * scene->light.intensity[c];
        collect(path, c, weight_of(path, c) * shadow.state.worth * light * power, seen);
    }
    const bits *held = path->state.held_rng;
    Rng next = {held[0], held[1], held[2], held[3]};
    scatter(path, scene, &next, goes_on(path, scene, seen));
    merge_rng(rng, &next, seen);
}
