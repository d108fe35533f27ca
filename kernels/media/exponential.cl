/* An exponential atmosphere, sigma_t exp(-z / scale height). */
static real sigma_t_at(const Scene *scene, const real x, const real y, const real z)
{
    return scene->medium.sigma_t * exp(-z * scene->medium.inverse_height);
}
