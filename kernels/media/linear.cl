/* bottom + slope z. */
static real sigma_t_at(const Scene *scene, const real x, const real y, const real z)
{
    return scene->medium.bottom + scene->medium.slope * z;
}
