/* As flight_names.cl, of trackers whose step is a tentative collision with a lookup: both are made once for all lanes,
   whichever of the two trackers they fly with, and given to it. */
#define begin(path, scene, rng) flight_begin(path, scene, rng)
#define step(path, scene, rng) path_step(path, scene, rng, const mask shared_here, const real shared_sigma)
#define next_tentative(path, scene, rng) shared_here
#define sigma_t_at_tentative(path, scene, here) shared_sigma
