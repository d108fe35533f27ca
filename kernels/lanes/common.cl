/* What reads the same for a scalar and for a vector. */
#define choose(m, yes, no) ((m) ? (yes) : (no))
#define smaller(a, b) choose(less(a, b), a, b)
#define larger(a, b) choose(less(a, b), b, a)

/* A distance or optical depth that nothing reaches; finite, so that 0 x FAR is 0 and relaxed arithmetic,
   which may assume that infinities do not occur, keeps it. */
#define FAR ((SCALAR)1e30)

static real saturate(const real x)
{
    const real above = larger(x, (real)0);
    return smaller(above, (real)1);
}
