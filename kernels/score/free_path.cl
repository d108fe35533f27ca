/* The distance flown inside the medium, to the first collision or the end of the ray: its expectation is
   the integral of transmittance along the ray. */
static real sampled_depth(Rng *rng) { return exponential(rng); }

static real attenuation(const real depth) { return (real)1; }

static real score(const real weight, const real t, const mask escaped) { return weight * t; }
