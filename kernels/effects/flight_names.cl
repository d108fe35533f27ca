/* The tracker that follows samples single flights; a path has many. */
#define begin(path, scene, rng) flight_begin(path, scene, rng)
#define step(path, scene, rng) flight_step(path, scene, rng)
