/* A Gaussian blob, peak exp(-r^2 / (2 width^2)). */
static real sigma_t_at(const Scene *scene, const real x, const real y, const real z)
{
    const real u = (x - scene->medium.center_x) * scene->medium.inverse_width;
    const real v = (y - scene->medium.center_y) * scene->medium.inverse_width;
    const real w = (z - scene->medium.center_z) * scene->medium.inverse_width;
    return scene->medium.peak * exp((SCALAR)-0.5 * (u * u + v * v + w * w));
}
