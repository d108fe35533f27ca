/* Rayleigh 1871, On the light from the sky: without polarisation, in proportion to 1 + cosine^2. The cumulated density
   is a cubic, whose one root Cardano's formula gives; of its positive half, so that nothing cancels. */
static real sample_cosine(const Scene *scene, Rng *rng)
{
    const real side = (SCALAR)4 * uniform(rng) - (SCALAR)2, away = fabs(side);
    const real root = cbrt(away + sqrt(away * away + (SCALAR)1));
    const real cosine = clamp(root - (SCALAR)1 / root, (real)0, (real)1);
    return choose(less(side, (real)0), -cosine, cosine);
}

static real phase(const Scene *scene, const real cosine)
{
    return (SCALAR)0.05968310365946075 * ((SCALAR)1 + cosine * cosine);
}
