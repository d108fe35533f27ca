/* Random numbers: one Philox 4x32-10 block (Salmon et al. 2011, Parallel random numbers: as easy as
   1, 2, 3) of key = seed and counter = (ray, sample) seeds a xoshiro128++ (Blackman and Vigna 2021)
   for each sample. So a sample depends on nothing but its seed, its ray and its number. */
typedef struct {
    bits s0, s1, s2, s3;
} Rng;

static void take_rng(Rng *into, const Rng *from, const mask where)
{
    const bits_mask narrow = narrow_mask(where);
    into->s0 = choose(narrow, from->s0, into->s0);
    into->s1 = choose(narrow, from->s1, into->s1);
    into->s2 = choose(narrow, from->s2, into->s2);
    into->s3 = choose(narrow, from->s3, into->s3);
}

static bits rotate_left(const bits x, const uint k) { return (x << k) | (x >> (32 - k)); }

static bits next_bits(Rng *rng)
{
    const bits result = rotate_left(rng->s0 + rng->s3, 7) + rng->s0;
    const bits t = rng->s1 << 9;
    rng->s2 ^= rng->s0;
    rng->s3 ^= rng->s1;
    rng->s1 ^= rng->s2;
    rng->s0 ^= rng->s3;
    rng->s2 ^= t;
    rng->s3 = rotate_left(rng->s3, 11);
    return result;
}

/* The high word by way of a 64-bit product: compilers know this form as one widening multiplication of
   vectors, while PoCL calls mul_hi element by element. */
static bits high_word(const bits x, const uint m) { return to_bits((to_wide(x) * (ulong)m) >> 32); }

static Rng philox(const Rng counter, uint key0, uint key1)
{
    Rng c = counter; /* rusticl 22.3 passes the caller's own struct: changing a parameter would change it */
    for (int round = 0; round < 10; ++round) {
        const Rng before = c;
        c.s0 = high_word(before.s2, 0xCD9E8D57u) ^ before.s1 ^ key0;
        c.s1 = before.s2 * 0xCD9E8D57u;
        c.s2 = high_word(before.s0, 0xD2511F53u) ^ before.s3 ^ key1;
        c.s3 = before.s0 * 0xD2511F53u;
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
    return c;
}

/* The stream of sample number first + offset of a ray. */
static Rng stream(const ulong seed, const bits ray, const ulong first, const bits offset)
{
    const bits low = offset + (uint)first;
    const bits high = (bits)(uint)(first >> 32) + carry(low, offset);
    const Rng counter = {ray, low, high, (bits)0};
    return philox(counter, (uint)seed, (uint)(seed >> 32));
}

/* A stream of its own for a tracker that needs a number beside those of its relatives, so that both still
   draw the same numbers where they do the same thing. */
static Rng companion(const Rng *rng) { return philox(*rng, 1u, 0u); }

/* In [0, 1), a multiple of 2^-24: exact in float, and 1 - u is exact too and never 0. */
static real uniform(Rng *rng) { return to_real(next_bits(rng) >> 8) * (SCALAR)5.9604644775390625e-8; }

/* An optical depth with the density exp(-x). The largest is 24 log 2 = 16.6: nothing is clamped. */
static real exponential(Rng *rng) { return -logarithm((SCALAR)1 - uniform(rng)); }
