/* A path of many flights: where one ends, the medium and the lights are asked what they do there. Only lanes
   at an end draw random numbers for it, so a sample is the same whatever its neighbours do. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    path_begin(path);
    flight_begin(path, scene, rng);
}

/* Where the main loop cuts a path off. */
#define MOST_STEPS (1 << 20)

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask before = path->live;
    flight_step(path, scene, rng);
    const mask ended = before & ~path->live;
    if (any_lane(ended)) {
        Rng here = *rng;
        at_end(path, scene, &here, ended);
        take_rng(rng, &here, ended);
    }
    path_end(path, before & (~path->live | ~less(path->steps, (index)MOST_STEPS)));
}
