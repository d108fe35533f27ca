/*---
title: Closed form of a Gaussian blob along a ray
uses: [media/closed_form_by_newton]
---*/
/* Along a ray the blob is a Gaussian of the distance from its closest approach, at t = -b. */
static real optical_depth(const Path *path, const Scene *scene, const real t)
{
    const SCALAR inverse = scene->medium.inverse_width;
    const real u = (path->ray.origin.x - scene->medium.center_x) * inverse;
    const real v = (path->ray.origin.y - scene->medium.center_y) * inverse;
    const real w = (path->ray.origin.z - scene->medium.center_z) * inverse;
    const real b = u * path->ray.direction.x + v * path->ray.direction.y + w * path->ray.direction.z;
    const real off_x = u - b * path->ray.direction.x, off_y = v - b * path->ray.direction.y, off_z = w - b * path->ray.direction.z;
    const real peak = scene->medium.peak * exp((SCALAR)-0.5 * (off_x * off_x + off_y * off_y + off_z * off_z));
    const SCALAR sqrt_half = (SCALAR)0.70710678118654752, sqrt_half_pi = (SCALAR)1.2533141373155003;
    const real span = erf((b + t * inverse) * sqrt_half) - erf(b * sqrt_half);
    return peak * (sqrt_half_pi / inverse) * span;
}
