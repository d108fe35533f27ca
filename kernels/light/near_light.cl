/*---
title: Distances that are chosen with a light in mind
state: {reach: real, density: real}
---*/
/* Where a ray passes the point light, and the density of distances that the light sees under equal angles. */
typedef struct {
    real nearest;             /* distance along the ray at which it passes */
    real off;                 /* how far beside the light that is */
    real angle;               /* between the ray's two ends, seen from the light */
} Pass;

/* `near` is a lower bound of how far off, in lengths of the ray, for a light on it: any density that is nowhere 0
   is right. */
static Pass pass_light_by(const Path *path, const Scene *scene, const SCALAR near)
{
    const Vector at = path->ray.origin;
    const Vector way = {scene->light.x - at.x, scene->light.y - at.y, scene->light.z - at.z};
    const Vector to_light = mapped(scene->space.to_world, way), ahead = heading(path, scene);
    Pass pass;
    pass.nearest = dot_of(to_light, ahead);
    const Vector beside = {to_light.x - pass.nearest * ahead.x, to_light.y - pass.nearest * ahead.y,
                           to_light.z - pass.nearest * ahead.z};
    const real off = sqrt(dot_of(beside, beside));
    const real least = near * path->ray.length + (SCALAR)1e-20;
    pass.off = larger(off, least);
    /* not the difference of two angles: far from the light both are nearly a right one */
    const real both = pass.off * pass.off - pass.nearest * (path->ray.length - pass.nearest);
    pass.angle = atan2(path->ray.length * pass.off, both);
    return pass;
}

static Pass pass_light(const Path *path, const Scene *scene) { return pass_light_by(path, scene, (SCALAR)1e-3); }

/* Which of the angles, in [0, 1], a distance is seen under. */
static real place_under_angle(const Pass pass, const real t)
{
    const real angle = atan2(t * pass.off, pass.off * pass.off - pass.nearest * (t - pass.nearest));
    return choose(less((real)0, pass.angle), angle / pass.angle, (real)0);
}

static real equiangular_distance(const Pass pass, const real u, const real length)
{
    const real angle = u * pass.angle;
    const real square = pass.off * pass.off + pass.nearest * pass.nearest;
    const real t = sin(angle) * square / (pass.off * cos(angle) + pass.nearest * sin(angle));
    return clamp(t, (real)0, length);
}

static real equiangular_density(const Pass pass, const real t)
{
    const real along = t - pass.nearest;
    return pass.off / (pass.angle * (pass.off * pass.off + along * along));
}

/* As next_tentative, on a ray that ends at `reach`. */
static mask next_tentative_within(Path *path, const Scene *scene, Rng *rng, const real reach)
{
    const real whole = path->ray.length;
    path->ray.length = reach;
    const mask here = next_tentative(path, scene, rng);
    path->ray.length = whole;
    return here;
}

/* One step of ratio tracking up to path->state.reach, a distance drawn with path->state.density; the flight ends
   there, and the extinction there enters its weight. */
static void step_to_reach(Path *path, const Scene *scene, Rng *rng)
{
    const mask before = path->live;
    const mask here = next_tentative_within(path, scene, rng, path->state.reach);
    const real sigma_n = path->majorant - sigma_t_at_tentative(path, scene, here);
    path->weight = choose(here, path->weight * (sigma_n / path->majorant), path->weight);
    const mask arrived = before & ~path->live;
    if (any_lane(arrived)) {
        const real density = sigma_t(path, scene, path->t, arrived) / path->state.density;
        path->weight = choose(arrived, path->weight * density, path->weight);
        path->escaped &= ~arrived;
    }
}
