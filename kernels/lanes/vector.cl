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
typedef JOIN(INTEGER, 16) mask16;
static int any_lane2(const mask2 m) { return (m.x | m.y) != 0; }
static int any_lane4(const mask4 m) { return any_lane2(m.lo | m.hi); }
static int any_lane8(const mask8 m) { return any_lane4(m.lo | m.hi); }
static int any_lane16(const mask16 m) { return any_lane8(m.lo | m.hi); }
static int lane_count2(const mask2 m) { return -(int)(m.x + m.y); }
static int lane_count4(const mask4 m) { return lane_count2(m.lo + m.hi); }
static int lane_count8(const mask8 m) { return lane_count4(m.lo + m.hi); }
static int lane_count16(const mask16 m) { return lane_count8(m.lo + m.hi); }
#ifndef BY_ELEMENT
#define any_lane(m) JOIN(any_lane, LANES)(m)
#define lane_count(m) JOIN(lane_count, LANES)(m)
#else
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
#define any_lane(m) (lane_count(m) != 0)
#endif

/* One load a lane, each by `load(p, i)`. */
#define load_each2(load, p, i) load(p, (i).s0), load(p, (i).s1)
#define load_each4(load, p, i) load_each2(load, p, i), load(p, (i).s2), load(p, (i).s3)
#define load_each8(load, p, i)                                                                     \
    load_each4(load, p, i), load(p, (i).s4), load(p, (i).s5), load(p, (i).s6), load(p, (i).s7)
#define load_each16(load, p, i)                                                                    \
    load_each8(load, p, i), load(p, (i).s8), load(p, (i).s9), load(p, (i).sa), load(p, (i).sb),    \
        load(p, (i).sc), load(p, (i).sd), load(p, (i).se), load(p, (i).sf)
#define load_lane(p, i) (p)[i]
#define gather_by(load, p, i) ((real)(JOIN(load_each, LANES)(load, p, i)))
#define gather(p, i) gather_by(load_lane, p, i)
