/* Densities in 16 bits (IEEE 754 binary16): `gather` for a pointer to them. vload_half is in every OpenCL and needs no
   cl_khr_fp16; what it returns is a float, a normal one of a denormal half too. */
#define half_at(p, i) vload_half((size_t)(i), p)
#if LANES == 1
#define gather_half(p, i) ((real)half_at(p, i))
#elif LANES == 2
#define gather_half(p, i) ((real)(half_at(p, (i).s0), half_at(p, (i).s1)))
#elif LANES == 4
#define gather_half(p, i)                                                                          \
    ((real)(half_at(p, (i).s0), half_at(p, (i).s1), half_at(p, (i).s2), half_at(p, (i).s3)))
#elif LANES == 8
#define gather_half(p, i)                                                                          \
    ((real)(half_at(p, (i).s0), half_at(p, (i).s1), half_at(p, (i).s2), half_at(p, (i).s3),        \
            half_at(p, (i).s4), half_at(p, (i).s5), half_at(p, (i).s6), half_at(p, (i).s7)))
#elif LANES == 16
#define gather_half(p, i)                                                                          \
    ((real)(half_at(p, (i).s0), half_at(p, (i).s1), half_at(p, (i).s2), half_at(p, (i).s3),        \
            half_at(p, (i).s4), half_at(p, (i).s5), half_at(p, (i).s6), half_at(p, (i).s7),        \
            half_at(p, (i).s8), half_at(p, (i).s9), half_at(p, (i).sa), half_at(p, (i).sb),        \
            half_at(p, (i).sc), half_at(p, (i).sd), half_at(p, (i).se), half_at(p, (i).sf)))
#endif
