/* The radiance that arrives at the start of a ray, or the length of a path in the medium: what a path collects where
   its flights end, and nothing beside. */
static real sampled_depth(Rng *rng) { return exponential(rng); }

static real attenuation(const real depth) { return (real)1; }

static real score(const real weight, const real t, const mask escaped) { return (real)0; }
