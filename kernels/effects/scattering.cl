/*---
title: Paths go on in a new direction
state:
  scatterings: index
  first_origin_x: real
  first_origin_y: real
  first_origin_z: real
  first_direction_x: real
  first_direction_y: real
  first_direction_z: real
  first_length: real
---*/
/* The ray of the first flight, which the next path of the lane starts on again. */
static void keep_ray(Path *path, const mask where)
{
    path->state.first_origin_x = choose(where, path->origin_x, path->state.first_origin_x);
    path->state.first_origin_y = choose(where, path->origin_y, path->state.first_origin_y);
    path->state.first_origin_z = choose(where, path->origin_z, path->state.first_origin_z);
    path->state.first_direction_x = choose(where, path->direction_x, path->state.first_direction_x);
    path->state.first_direction_y = choose(where, path->direction_y, path->state.first_direction_y);
    path->state.first_direction_z = choose(where, path->direction_z, path->state.first_direction_z);
    path->state.first_length = choose(where, path->length, path->state.first_length);
}

static void restore_ray(Path *path, const mask ended)
{
    const mask where = ended & less((index)0, path->state.scatterings);
    path->origin_x = choose(where, path->state.first_origin_x, path->origin_x);
    path->origin_y = choose(where, path->state.first_origin_y, path->origin_y);
    path->origin_z = choose(where, path->state.first_origin_z, path->origin_z);
    path->direction_x = choose(where, path->state.first_direction_x, path->direction_x);
    path->direction_y = choose(where, path->state.first_direction_y, path->direction_y);
    path->direction_z = choose(where, path->state.first_direction_z, path->direction_z);
    path->length = choose(where, path->state.first_length, path->length);
}

/* Lanes `here` have collided; those that may scatter once more go on, with the share of light that scatters. */
static void scatter(Path *path, const Scene *scene, Rng *rng, const mask here)
{
    mask on = here & less(path->state.scatterings, (index)(INTEGER)scene->optics.scatterings);
    keep_ray(path, on & equal(path->state.scatterings, (index)0));
    path->state.scatterings -= on;
    for (int c = 0; c < CHANNELS; ++c)
        tint(path, c, (real)scene->optics.albedo[c], on);
    on &= ~roulette(path, rng, on);
    if (!any_lane(on))
        return;
    const Vector turned = new_direction(path, scene, rng, on);
    Path next = *path;
    turn(&next, scene, turned, on);
    flight_begin(&next, scene, rng);
    path->origin_x = choose(on, next.origin_x, path->origin_x);
    path->origin_y = choose(on, next.origin_y, path->origin_y);
    path->origin_z = choose(on, next.origin_z, path->origin_z);
    path->direction_x = choose(on, next.direction_x, path->direction_x);
    path->direction_y = choose(on, next.direction_y, path->direction_y);
    path->direction_z = choose(on, next.direction_z, path->direction_z);
    path->length = choose(on, next.length, path->length);
    path->t = choose(on, next.t, path->t);
    path->depth = choose(on, next.depth, path->depth);
    path->target = choose(on, next.target, path->target);
    path->majorant = choose(on, next.majorant, path->majorant);
    path->mean_free_path = choose(on, next.mean_free_path, path->mean_free_path);
    path->weight = choose(on, next.weight, path->weight);
    path->lookups = choose(on, next.lookups, path->lookups);
    path->crossings = choose(on, next.crossings, path->crossings);
    merge_state(&path->state, &next.state, on);
    path->live |= on;
}
