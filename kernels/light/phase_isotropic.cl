/* All directions alike. */
#define ISOTROPIC

static real sample_cosine(const Scene *scene, Rng *rng) { return (SCALAR)2 * uniform(rng) - (SCALAR)1; }

static real phase(const Scene *scene, const real cosine) { return (real)(SCALAR)0.07957747154594767; }
