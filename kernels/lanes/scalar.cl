/* One path a work-item: every lane type is a plain scalar, under the names of lanes/vector.cl.
   A comparison that holds is 1 in C and must be -1 here, as it is for vectors. */
typedef SCALAR real;
typedef INTEGER mask;
typedef INTEGER index;
typedef uint bits;
typedef ulong wide_bits;
typedef int bits_mask;

#define equal(a, b) (-(INTEGER)((a) == (b)))
#define less(a, b) (-(INTEGER)((a) < (b)))
#define carry(sum, part) ((uint)((sum) < (part)))
#define any_lane(m) ((m) != 0)
#define lane_count(m) (-(int)(m))
#define narrow_mask(m) ((int)(m))
#define to_real(x) ((real)(x))
#define to_index(x) ((index)(x))
#define to_bits(x) ((bits)(x))
#define to_wide(x) ((wide_bits)(x))
#define as_real(x) as_float(x)
#define as_index(x) as_int(x)
#define as_bits(x) as_uint(x)
#define load_lane(p, i) (p)[i]
#define gather_by(load, p, i) ((real)load(p, i))
#define gather(p, i) gather_by(load_lane, p, i)
#define store_lanes(x, array) ((array)[0] = (x))
#define load_lanes(array) ((array)[0])
