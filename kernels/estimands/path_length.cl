/* The length of a path in the medium, over all of its flights. */
static real sampled_depth(Rng *rng) { return exponential(rng); }

static real attenuation(const real depth) { return (real)1; }

static real score(const real weight, const real t, const mask escaped) { return (real)0; }
