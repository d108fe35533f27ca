/* Distances along a ray of a density proportional to 1 / distance from a point, of which the ray's nearest point is
   `least` away. To either side of it the ray recedes; `beyond` is how far behind an end of the ray it would have
   come nearer, 0 where it passes the point. Sums of what is positive alone: nothing cancels, near or far. */
typedef struct {
    real nearest;             /* distance along the ray to its nearest point */
    real least, beyond;
    real before, after;       /* integrals of 1 / distance on either side */
} Receding;

static real integral_receding(const Receding from, const real off, const real way)
{
    const real side = from.beyond + way;
    const real distance = sqrt(off * off + side * side);
    const real farther = way * (way + (SCALAR)2 * from.beyond) / (distance + from.least);
    return log1p((way + farther) / (from.beyond + from.least));
}

/* The way with such an integral. */
static real way_receding(const Receding from, const real integral)
{
    const real growth = expm1(integral);
    const real twice = from.least * (growth + (SCALAR)2) + from.beyond * growth;
    return growth / (growth + (SCALAR)1) * (SCALAR)0.5 * twice;
}

/* Of a ray of a length that passes at the distance `off` where it is `passing` long. */
static Receding receding_from(const real off, const real passing, const real length)
{
    Receding from;
    from.nearest = clamp(passing, (real)0, length);
    from.beyond = fabs(passing - from.nearest);
    from.least = sqrt(off * off + from.beyond * from.beyond);
    from.before = integral_receding(from, off, from.nearest);
    from.after = integral_receding(from, off, length - from.nearest);
    return from;
}

static real inverse_distance(const Receding from, const real u, const real length)
{
    const real along = u * (from.before + from.after) - from.before;
    const real way = way_receding(from, fabs(along));
    return clamp(from.nearest + copysign(way, along), (real)0, length);
}

/* A ray without length has a density of any size: its paths weigh nothing. */
static real inverse_distance_density(const Receding from, const real off, const real along)
{
    const real whole = from.before + from.after, least = (real)(SCALAR)1e-30;
    return (SCALAR)1 / (larger(whole, least) * sqrt(off * off + along * along));
}
