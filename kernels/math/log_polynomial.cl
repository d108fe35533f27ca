/* The natural logarithm of a positive normal float. x = m 2^e with m in [sqrt(1/2), sqrt(2)), and
   log(1 + f) = f - f^2/2 + f^3 P(f) with the minimax polynomial P of Moshier's Cephes library (logf).
   log 2 is split so that e times its first part is exact. */
static real logarithm(const real x)
{
    const bits offset = as_bits(x) - 0x3f3504f3u;               /* 0x3f3504f3: sqrt(1/2) */
    const real e = to_real(as_index(offset) >> 23);
    const real f = as_real((offset & 0x007fffffu) + 0x3f3504f3u) - 1.0f;
    const real f2 = f * f;
    real p = 7.0376836292e-2f * f - 1.1514610310e-1f;
    p = p * f + 1.1676998740e-1f;
    p = p * f - 1.2420140846e-1f;
    p = p * f + 1.4249322787e-1f;
    p = p * f - 1.6668057665e-1f;
    p = p * f + 2.0000714765e-1f;
    p = p * f - 2.4999993993e-1f;
    p = p * f + 3.3333331174e-1f;
    const real tail = f * f2 * p - 2.12194440e-4f * e - 0.5f * f2;
    return f + tail + 0.693359375f * e;
}
