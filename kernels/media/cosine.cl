/* mean (1 + amplitude cos(wavenumber z + phase)). */
static real sigma_t_at(const Scene *scene, const real x, const real y, const real z)
{
    const real wave = cos(scene->medium.wavenumber * z + scene->medium.phase);
    return scene->medium.mean * ((SCALAR)1 + scene->medium.amplitude * wave);
}
