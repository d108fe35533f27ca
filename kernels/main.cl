/* The persistent loop: a lane whose path has ended takes the next sample of its unit at once, and the
   next unit when that is done; the loop ends when no unit is left and no lane is live. A unit is a block
   of `samples` samples of one ray: unit u belongs to ray u % rays. */

/* Idle lanes wait until there are so many: starting one sample costs as much as starting a sample in every
   lane. Of 16 lanes, waiting for four took 6 % off the time of a sample for 9 % of the occupancy. */
#define REFILL ((LANES + 3) / 4)

/* Lanes `where` take the next units, while there are any, and load their rays. */
static void next_unit(Tally *tally, Path *path, const mask where, __global uint *taken, const uint units,
                      const uint rays, __global const SCALAR *ray_data)
{
    INTEGER wanting[LANES], unit[LANES];
    store_lanes(where, wanting);
    store_lanes(tally->unit, unit);
    for (int lane = 0; lane < LANES; ++lane) {
        if (!wanting[lane])
            continue;
        const uint next = atomic_inc(taken);
        unit[lane] = next < units ? (INTEGER)next : (INTEGER)-1;
    }
    tally->unit = load_lanes(unit);
    tally_begin(tally, path, where);
    const index ray = larger(tally->unit, (index)0) % (index)(INTEGER)rays * 7;
    const Ray next = {{gather(ray_data, ray), gather(ray_data + 1, ray), gather(ray_data + 2, ray)},
                      {gather(ray_data + 3, ray), gather(ray_data + 4, ray), gather(ray_data + 5, ray)},
                      gather(ray_data + 6, ray)};
    take_ray(&path->ray, &next, where);
}

/* Lanes `where` start their next sample. It is begun in full for all lanes and then taken over by those,
   so that a tracker's begin needs no mask and lanes under way draw no random numbers. */
static void next_sample(const Tally *tally, Path *path, Rng *rng, const mask where, const Scene *scene,
                        const ulong seed, const ulong first_sample, const uint samples, const uint rays)
{
    const index unit = larger(tally->unit, (index)0);
    const index block = unit / (index)(INTEGER)rays;
    const index ray = unit - block * (index)(INTEGER)rays;
    const index number = block * (index)(INTEGER)samples + tally->done;
    Rng new_rng = stream(seed, to_bits(ray), first_sample, to_bits(number));
    Path new_path = *path;
    start_flight(&new_path, (mask)-1);
    new_path.weight = (real)1;
    new_path.live = (mask)-1;
    new_path.escaped = (mask)0;
    new_path.steps = (index)0;
    channels_begin(&new_path);
    begin(&new_path, scene, &new_rng);
    take_rng(rng, &new_rng, where);
    take_flight(path, &new_path, where);
}

__kernel void track(const ulong seed, const ulong first_sample, const uint samples, const uint units,
                    const uint rays, const uint step_cap, __constant const Numbers *numbers,
                    __global const SCALAR *ray_data, __global const float *medium_data,
                    __global const float *majorant_data, __global uint *taken, __global SCALAR *moments,
                    __global uint *counters, __global ulong *iterations, __global SCALAR *recorded)
{
    const Scene scene = make_scene(numbers, medium_data, majorant_data);
    const Path no_path = {{{(real)0}}};
    const Tally no_tally = {(index)-1};
    Path path = no_path;
    Tally tally = no_tally;
    Rng rng = {(bits)0, (bits)0, (bits)0, (bits)0};
    tally.done = (index)(INTEGER)samples;
    mask working = (mask)-1;
    ulong iteration = 0;
    for (;;) {
        const mask idle = working & ~path.live;
        if (lane_count(idle) >= REFILL || !any_lane(path.live)) {
            const mask used_up = idle & ~less(tally.done, (index)(INTEGER)samples);
            if (any_lane(used_up)) {
                tally_store(&tally, &path, used_up, moments, counters);
                next_unit(&tally, &path, used_up, taken, units, rays, ray_data);
                working &= ~less(tally.unit, (index)0);
                if (!any_lane(working))
                    break;
            }
            next_sample(&tally, &path, &rng, idle & working, &scene, seed, first_sample, samples, rays);
        }
        const mask before = path.live;
        path.steps -= before;
        step(&path, &scene, &rng);
        ++iteration;
        const mask truncated = path.live & ~less(path.steps, (index)(INTEGER)step_cap);
        path.live &= ~truncated;
        const mask ended = before & ~path.live;
        if (any_lane(ended)) {
            tally_sample(&tally, &path, ended, truncated);
            record(&tally, &path, ended, samples, recorded);
        }
    }
    iterations[get_global_id(0)] = iteration;
}
