#undef step
#define step(path, scene, rng) shadow_step(path, scene, rng, const mask shared_here, const real shared_sigma)
