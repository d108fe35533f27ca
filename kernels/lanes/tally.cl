/* What a lane keeps of the unit it works on: a block of samples of one ray. Welford's update in the lane;
   the host merges units in double (Chan, Golub, LeVeque 1983), so no sum runs long in float. The mean is
   kept in two parts (Kahan 1965): where all scores are nearly 1, as in thin media, the share of one of
   them is less than the last bit of a float, and the mean would stand still. */
typedef struct {
    index unit;               /* -1: none */
    index done;               /* samples finished */
    real mean, excess;        /* of their scores; the mean is mean - excess */
    real m2;                  /* sum of squared deviations from it */
    index steps;              /* over all samples */
    index truncated;          /* samples that reached the step cap */
    index nonfinite;          /* samples whose score is infinite or not a number; never left out */
} Tally;

static void tally_begin(Tally *tally, Path *path, const mask where)
{
    tally->done = choose(where, (index)0, tally->done);
    tally->mean = choose(where, (real)0, tally->mean);
    tally->excess = choose(where, (real)0, tally->excess);
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
    const real deviation = x - tally->mean + tally->excess;
    const real rise = deviation / to_real(tally->done) - tally->excess;
    const real mean = tally->mean + rise;
    const real excess = mean - tally->mean - rise;
    tally->m2 = choose(ended, tally->m2 + deviation * (x - mean + excess), tally->m2);
    tally->excess = choose(ended, excess, tally->excess);
    tally->mean = choose(ended, mean, tally->mean);
}

/* The results of the units that lanes `where` have finished, in the order of the host's COUNTERS. */
static void tally_store(const Tally *tally, const Path *path, const mask where, __global SCALAR *moments,
                        __global uint *counters)
{
    INTEGER finished[LANES], unit[LANES], values[6][LANES];
    SCALAR mean[LANES], excess[LANES], m2[LANES];
    store_lanes(where & ~less(tally->unit, (index)0), finished);
    store_lanes(tally->unit, unit);
    store_lanes(tally->mean, mean);
    store_lanes(tally->excess, excess);
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
        moments[3 * unit[lane]] = mean[lane];
        moments[3 * unit[lane] + 1] = excess[lane];
        moments[3 * unit[lane] + 2] = m2[lane];
        for (int i = 0; i < 6; ++i)
            counters[6 * unit[lane] + i] = (uint)values[i][lane];
    }
}
