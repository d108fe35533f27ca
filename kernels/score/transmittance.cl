/* The share of light that crosses the medium: the weight of the paths that escape. A tracker that knows
   the optical depth along the whole ray need not draw a collision: it never reaches FAR. */
static real sampled_depth(Rng *rng) { return (real)FAR; }

static real attenuation(const real depth) { return exp(-depth); }

static real score(const real weight, const real t, const mask escaped) { return choose(escaped, weight, (real)0); }
