/* What a lane keeps of the unit it works on: a block of samples of one ray. Welford's update in the lane;
   the host merges units in double (Chan, Golub, LeVeque 1983), so no sum runs long in float. */
typedef struct {
    index unit;               /* -1: none */
    index done;               /* samples finished */
    real mean, m2;            /* of their scores; m2: sum of squared deviations */
    index steps;              /* over all samples */
    index truncated;          /* samples that reached the step cap */
    index nonfinite;          /* samples whose score is infinite or not a number; never left out */
} Tally;

static void tally_begin(Tally *tally, Path *path, const mask where)
{
    tally->done = choose(where, (index)0, tally->done);
    tally->mean = choose(where, (real)0, tally->mean);
    tally->m2 = choose(where, (real)0, tally->m2);
    tally->steps = choose(where, (index)0, tally->steps);
    tally->truncated = choose(where, (index)0, tally->truncated);
    tally->nonfinite = choose(where, (index)0, tally->nonfinite);
    path->lookups = choose(where, (index)0, path->lookups);
    path->crossings = choose(where, (index)0, path->crossings);
    path->violations = choose(where, (index)0, path->violations);
}

static void tally_sample(Tally *tally, const Path *path, const mask ended, const mask truncated)
{
    const real x = path->collected + score(path->weight, path->t, path->escaped);
    tally->done -= ended;
    tally->steps += ended & path->steps;
    tally->truncated -= truncated;
    tally->nonfinite -= ended & ~less(fabs(x), (real)INFINITY);
    const real deviation = x - tally->mean;
    const real mean = tally->mean + deviation / to_real(tally->done);
    tally->m2 = choose(ended, tally->m2 + deviation * (x - mean), tally->m2);
    tally->mean = choose(ended, mean, tally->mean);
}

/* The results of the units that lanes `where` have finished, in the order of the host's COUNTERS. */
static void tally_store(const Tally *tally, const Path *path, const mask where, __global SCALAR *moments,
                        __global uint *counters)
{
    INTEGER finished[LANES], unit[LANES], values[6][LANES];
    SCALAR mean[LANES], m2[LANES];
    store_lanes(where & ~less(tally->unit, (index)0), finished);
    store_lanes(tally->unit, unit);
    store_lanes(tally->mean, mean);
    store_lanes(tally->m2, m2);
    store_lanes(path->lookups, values[0]);
    store_lanes(path->crossings, values[1]);
    store_lanes(path->violations, values[2]);
    store_lanes(tally->steps, values[3]);
    store_lanes(tally->truncated, values[4]);
    store_lanes(tally->nonfinite, values[5]);
    for (int lane = 0; lane < LANES; ++lane) {
        if (!finished[lane])
            continue;
        moments[2 * unit[lane]] = mean[lane];
        moments[2 * unit[lane] + 1] = m2[lane];
        for (int i = 0; i < 6; ++i)
            counters[6 * unit[lane] + i] = (uint)values[i][lane];
    }
}
