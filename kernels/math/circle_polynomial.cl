/* Cosine and sine of 2 pi u, u in [0, 1): their series on an eighth of the circle, whose next terms are below
   3e-8. Of 16 lanes the built-in functions are several times as slow on PoCL. */
static void point_on_circle(const real u, real *cosine, real *sine)
{
    const real quarters = (SCALAR)4 * u;
    const index quarter = to_index(quarters + (SCALAR)0.5);
    const real x = (quarters - to_real(quarter)) * (SCALAR)1.57079632679489662;
    const real y = x * x;
    const real s = x * ((SCALAR)1 + y * ((SCALAR)-1.6666666667e-1 + y * ((SCALAR)8.3333333333e-3
                   + y * ((SCALAR)-1.9841269841e-4 + y * (SCALAR)2.7557319224e-6))));
    const real c = (SCALAR)1 + y * ((SCALAR)-0.5 + y * ((SCALAR)4.1666666667e-2
                   + y * ((SCALAR)-1.3888888889e-3 + y * (SCALAR)2.4801587302e-5)));
    const mask odd = -(quarter & 1), low = -((quarter >> 1) & 1), left = -(((quarter + 1) >> 1) & 1);
    const real along = choose(odd, s, c), across = choose(odd, c, s);
    *cosine = choose(left, -along, along);
    *sine = choose(low, -across, across);
}
