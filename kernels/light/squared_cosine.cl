/*---
title: The lobe of Henyey and Greenstein, times 1 + alpha cosine^2
uses: [math/newton]
---*/
static SCALAR squared_norm(const SCALAR g, const SCALAR alpha)
{
    return (SCALAR)1 + alpha * ((SCALAR)1 + (SCALAR)2 * g * g) / (SCALAR)3;
}

/* Of Henyey and Greenstein v, twice the chance of a smaller cosine, is uniform in [0, 2]. Here it has a density of
   1 + alpha cosine^2, whose integral from 0 is inverted by Newton's method; nothing in it is divided by g. */
static real squared_cosine(const SCALAR g, const SCALAR alpha, Rng *rng)
{
    const SCALAR sharp = fabs(g), ahead = ((SCALAR)1 + sharp) * ((SCALAR)1 + sharp);
    const real wanted = (SCALAR)2 * uniform(rng) * squared_norm(g, alpha);
    Bracket bracket = {(real)0, (real)2, wanted / squared_norm(g, alpha), (real)FAR};
    real cosine = (real)0;
    for (int i = 0; i < NEWTON_STEPS; ++i) {
        const real v = bracket.at, base = (SCALAR)1 - sharp + sharp * v;
        const real m = v / base, n = ahead * m;
        cosine = n * ((SCALAR)1 - sharp + (SCALAR)0.5 * sharp * v) / base - (SCALAR)1;
        const real square = (SCALAR)1 - n + n * n * ((SCALAR)4 - sharp * m) / (SCALAR)12;
        const real slope = (SCALAR)1 + alpha * cosine * cosine;
        if (!any_lane(newton(&bracket, v + alpha * v * square - wanted, slope)))
            break;
    }
    return clamp(g < (SCALAR)0 ? -cosine : cosine, (real)-1, (real)1);
}

static real squared_density(const SCALAR g, const SCALAR alpha, const real cosine)
{
    const SCALAR sharp = fabs(g);
    const real inside = g < (SCALAR)0 ? (SCALAR)1 + cosine : (SCALAR)1 - cosine;
    const real square = ((SCALAR)1 - sharp) * ((SCALAR)1 - sharp) + (SCALAR)2 * sharp * inside;
    const real lobe = ((SCALAR)1 - sharp) * ((SCALAR)1 + sharp) * rsqrt(square) / square;
    return (SCALAR)0.07957747154594767 / squared_norm(g, alpha) * lobe * ((SCALAR)1 + alpha * cosine * cosine);
}
