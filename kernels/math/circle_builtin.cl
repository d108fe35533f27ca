/* Cosine and sine of 2 pi u. */
static void point_on_circle(const real u, real *cosine, real *sine)
{
    *cosine = cospi((SCALAR)2 * u);
    *sine = sinpi((SCALAR)2 * u);
}
