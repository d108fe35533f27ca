/*---
title: Closed form of a cosine along a ray
uses: [media/closed_form_by_newton]
---*/
/* With x the phase that the ray runs through: tau = mean t (1 + amplitude cos(start + x / 2) sin(x / 2) / (x / 2)),
   the form that a horizontal ray, x = 0, does not divide by 0. Its inverse is Kepler's equation. */
static real optical_depth(const Path *path, const Scene *scene, const real t)
{
    const real start = scene->medium.wavenumber * path->ray.origin.z + scene->medium.phase;
    const real half_x = (SCALAR)0.5 * scene->medium.wavenumber * path->ray.direction.z * t;
    const mask flat = equal(half_x, (real)0);
    const real sinc = choose(flat, (real)1, sin(half_x) / choose(flat, (real)1, half_x));
    return scene->medium.mean * t * ((SCALAR)1 + scene->medium.amplitude * cos(start + half_x) * sinc);
}
