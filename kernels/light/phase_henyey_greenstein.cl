/* Henyey and Greenstein 1941, Diffuse radiation in the galaxy. The cosine is that between the directions before
   and after; its mean is g. */
static real sample_cosine(const Scene *scene, Rng *rng)
{
    const SCALAR g = scene->optics.g;
    const real s = (SCALAR)2 * uniform(rng) - (SCALAR)1;
    const real base = (SCALAR)1 + g * s;
    if (fabs(g) > (SCALAR)0.5) {
        const real quotient = ((SCALAR)1 - g * g) / base;
        return clamp(((SCALAR)1 + g * g - quotient * quotient) / ((SCALAR)2 * g), (real)-1, (real)1);
    }
    /* the same, multiplied out: nothing is divided by a g near 0 */
    const real square = s * s;
    const real top = s + (SCALAR)0.5 * g * (square + (SCALAR)3) + g * g * (s + (SCALAR)0.5 * g * (square - (SCALAR)1));
    return clamp(top / (base * base), (real)-1, (real)1);
}

static real phase(const Scene *scene, const real cosine)
{
    const SCALAR g = scene->optics.g;
    /* (1 - |g|)^2 + 2 |g| (1 - cosine), of the cosine to the lobe: its digits are kept where that is sharp */
    const SCALAR sharp = fabs(g);
    const real inside = g < (SCALAR)0 ? (SCALAR)1 + cosine : (SCALAR)1 - cosine;
    const real square = ((SCALAR)1 - sharp) * ((SCALAR)1 - sharp) + (SCALAR)2 * sharp * inside;
    return (SCALAR)0.07957747154594767 * ((SCALAR)1 - sharp) * ((SCALAR)1 + sharp) * rsqrt(square) / square;
}
