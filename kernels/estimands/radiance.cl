/* The radiance that arrives at the start of a ray: what a path collects from the medium and from lights where
   it collides and where it leaves. */
static real sampled_depth(Rng *rng) { return exponential(rng); }

static real attenuation(const real depth) { return (real)1; }

static real score(const real weight, const real t, const mask escaped) { return (real)0; }
