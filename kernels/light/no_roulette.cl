/* The number of scatterings is bounded: every path goes on until then. */
static mask roulette(Path *path, const Scene *scene, Rng *rng, const mask on) { return (mask)0; }
