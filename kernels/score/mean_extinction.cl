/* The mean extinction of the medium's box, estimated by the weight. */
static real attenuation(const real depth) { return (real)1; }

static real score(const real weight, const real t, const mask escaped) { return weight; }
