/* The phase function on the way along the ray, by turns of the same angle seen from the light. */
typedef struct {
    real ahead, aside;        /* cosine and sine of the angle of scattering */
    real cosine, sine;        /* of a turn */
} Turning;

static Turning turning(const Pass pass, const int cells)
{
    const real turn = pass.angle / cells, inverse = rsqrt(pass.off * pass.off + pass.nearest * pass.nearest);
    const Turning start = {pass.nearest * inverse, pass.off * inverse, cos(turn), sin(turn)};
    return start;
}

static real phase_of_next(Turning *at, const Scene *scene)
{
    const real ahead = at->ahead * at->cosine - at->aside * at->sine;
    at->aside = at->aside * at->cosine + at->ahead * at->sine;
    at->ahead = clamp(ahead, (real)-1, (real)1);
    return phase(scene, at->ahead);
}

/* The phase function at the ends of even cells of the angle, linear between. Lanes `known` have a place among
   the angles, in [0, 1]; the others find one by u. Returns the density there. */
static real tabulated_angle(const Scene *scene, const Pass pass, const real u, const mask known, real *place)
{
    const int cells = (int)scene->tracker.cells;
    const Turning start = turning(pass, cells);
    const real least = phase(scene, start.ahead);
    Turning at = start;
    real sum = (SCALAR)0.5 * least;
    for (int cell = 1; cell <= cells; ++cell)
        sum += (cell < cells ? (SCALAR)1 : (SCALAR)0.5) * phase_of_next(&at, scene);
    at = start;
    real left = u * sum, first = least, low = least, high = least, below = (real)0, rest = (real)0;
    mask looking = (mask)-1;
    for (int cell = 0; cell < cells; ++cell) {
        const real last = phase_of_next(&at, scene), area = (SCALAR)0.5 * (first + last);
        const real given = *place * cells - (SCALAR)cell;
        const mask within = choose(known, less(given, (real)1), less(left, area));
        const mask here = looking & (cell == cells - 1 ? (mask)-1 : within);
        low = choose(here, first, low);
        high = choose(here, last, high);
        rest = choose(here, left, rest);
        below = choose(here, (real)(SCALAR)cell, below);
        left -= area;
        looking &= ~here;
        if (!any_lane(looking))
            break;
        first = last;
    }
    const real inside = clamp(rest, (real)0, (SCALAR)0.5 * (low + high)), none = (real)0;
    const real square = low * low + (SCALAR)2 * (high - low) * inside;
    const real found = (SCALAR)2 * inside / (low + sqrt(larger(square, none)));
    const real part = saturate(choose(known, *place * cells - below, found));
    *place = choose(known, *place, (below + part) / cells);
    return (low * ((SCALAR)1 - part) + high * part) * cells / sum;
}
