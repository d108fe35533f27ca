/* LANES paths a work-item, one in each element of an OpenCL vector. A mask is -1 where it holds and 0
   elsewhere: masks combine with & | ~, and counting them is a subtraction. */
#define JOIN_NAMES(a, b) a##b
#define JOIN(a, b) JOIN_NAMES(a, b)
typedef JOIN(SCALAR, LANES) real;
typedef JOIN(INTEGER, LANES) mask;
typedef JOIN(INTEGER, LANES) index;
typedef JOIN(uint, LANES) bits;
typedef JOIN(ulong, LANES) wide_bits;
typedef JOIN(int, LANES) bits_mask;

#define equal(a, b) ((a) == (b))
#define less(a, b) ((a) < (b))
#define carry(sum, part) JOIN(as_uint, LANES)(-((sum) < (part)))
#define narrow_mask(m) JOIN(convert_int, LANES)(m)
#define to_real(x) JOIN(JOIN(convert_, SCALAR), LANES)(x)
#define to_index(x) JOIN(JOIN(convert_, INTEGER), LANES)(x)
#define to_bits(x) JOIN(convert_uint, LANES)(x)
#define to_wide(x) JOIN(convert_ulong, LANES)(x)
#define as_real(x) JOIN(as_float, LANES)(x)
#define as_index(x) JOIN(as_int, LANES)(x)
#define as_bits(x) JOIN(as_uint, LANES)(x)
#define store_lanes(x, array) JOIN(vstore, LANES)(x, 0, array)
#define load_lanes(array) JOIN(vload, LANES)(0, array)

/* any() tests element by element on PoCL; folding halves took a tenth off a step of 16 lanes. */
typedef JOIN(INTEGER, 2) mask2;
typedef JOIN(INTEGER, 4) mask4;
typedef JOIN(INTEGER, 8) mask8;

#if LANES == 2
static int any_lane(const mask m) { return (m.x | m.y) != 0; }
static int lane_count(const mask m) { return -(int)(m.x + m.y); }
#define gather(p, i) ((real)((p)[(i).s0], (p)[(i).s1]))
#elif LANES == 4
static int any_lane(const mask m)
{
    const mask2 half2 = m.lo | m.hi;
    return (half2.x | half2.y) != 0;
}
static int lane_count(const mask m)
{
    const mask2 sum2 = m.lo + m.hi;
    return -(int)(sum2.x + sum2.y);
}
#define gather(p, i) ((real)((p)[(i).s0], (p)[(i).s1], (p)[(i).s2], (p)[(i).s3]))
#elif LANES == 8
static int any_lane(const mask m)
{
    const mask4 half4 = m.lo | m.hi;
    const mask2 half2 = half4.lo | half4.hi;
    return (half2.x | half2.y) != 0;
}
static int lane_count(const mask m)
{
    const mask4 sum4 = m.lo + m.hi;
    const mask2 sum2 = sum4.lo + sum4.hi;
    return -(int)(sum2.x + sum2.y);
}
#define gather(p, i)                                                                               \
    ((real)((p)[(i).s0], (p)[(i).s1], (p)[(i).s2], (p)[(i).s3], (p)[(i).s4], (p)[(i).s5],          \
            (p)[(i).s6], (p)[(i).s7]))
#elif LANES == 16
#ifdef BY_ELEMENT
/* Oclgrind 21.10 takes element 3 of the sum of two halves of 16 for uninitialised. */
static int lane_count(const mask m)
{
    INTEGER one[LANES];
    store_lanes(m, one);
    int count = 0;
    for (int lane = 0; lane < LANES; ++lane)
        count -= (int)one[lane];
    return count;
}
static int any_lane(const mask m) { return lane_count(m) != 0; }
#else
static int any_lane(const mask m)
{
    const mask8 half8 = m.lo | m.hi;
    const mask4 half4 = half8.lo | half8.hi;
    const mask2 half2 = half4.lo | half4.hi;
    return (half2.x | half2.y) != 0;
}
static int lane_count(const mask m)
{
    const mask8 sum8 = m.lo + m.hi;
    const mask4 sum4 = sum8.lo + sum8.hi;
    const mask2 sum2 = sum4.lo + sum4.hi;
    return -(int)(sum2.x + sum2.y);
}
#endif
#define gather(p, i)                                                                               \
    ((real)((p)[(i).s0], (p)[(i).s1], (p)[(i).s2], (p)[(i).s3], (p)[(i).s4], (p)[(i).s5],          \
            (p)[(i).s6], (p)[(i).s7], (p)[(i).s8], (p)[(i).s9], (p)[(i).sa], (p)[(i).sb],          \
            (p)[(i).sc], (p)[(i).sd], (p)[(i).se], (p)[(i).sf]))
#endif
