/* Constant extinction. */
static real sigma_t_at(const Scene *scene, const real x, const real y, const real z)
{
    return (real)scene->medium.sigma_t;
}
