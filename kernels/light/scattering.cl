/*---
title: Paths go on in a new direction
state: {scatterings: index, first_ray: Ray}
---*/
/* Lanes `here` have collided; those that may scatter there. */
static mask scatters(const Path *path, const Scene *scene, const mask here)
{
    return here & less(path->state.scatterings, (index)(INTEGER)scene->optics.scatterings);
}

/* The next path of a lane starts on the ray of the first flight again. */
static void restore_ray(Path *path, const mask ended)
{
    take_ray(&path->ray, &path->state.first_ray, ended & less((index)0, path->state.scatterings));
}

/* Lanes `here` have collided; those that may scatter once more go on, with the share of light that scatters. */
static void scatter(Path *path, const Scene *scene, Rng *rng, const mask here)
{
    mask on = scatters(path, scene, here);
    take_ray(&path->state.first_ray, &path->ray, on & equal(path->state.scatterings, (index)0));
    path->state.scatterings -= on;
    for (int c = 0; c < CHANNELS; ++c)
        scale_throughput(path, c, (real)scene->optics.albedo[c], on);
    on &= ~roulette(path, scene, rng, on);
    if (!any_lane(on))
        return;
    const Vector turned = new_direction(path, scene, rng, on);
    Path next = *path;
    turn(&next, scene, turned, on);
    flight_begin(&next, scene, rng);
    take_ray(&path->ray, &next.ray, on);
    take_flight(path, &next, on);
    path->live |= on;
}
