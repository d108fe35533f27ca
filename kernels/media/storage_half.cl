/* Densities in 16 bits (IEEE 754 binary16): `gather` for a pointer to them. vload_half is in every OpenCL and needs no
   cl_khr_fp16; what it returns is a float, a normal one of a denormal half too. */
#define half_at(p, i) vload_half((size_t)(i), p)
#define gather_half(p, i) gather_by(half_at, p, i)
