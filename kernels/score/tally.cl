/* What a lane keeps of the unit it works on: a block of samples of one ray. Welford's update in the lane;
   the host merges units in double (Chan, Golub, LeVeque 1983), so no sum runs long in float. The mean is
   kept in two parts (Kahan 1965): where all scores are nearly 1, as in thin media, the share of one of
   them is less than the last bit of a float, and the mean would stand still. Of several channels the mean
   over them is tallied too, as one more: they are correlated, and its variance tells by how much. */
#define TALLIED (CHANNELS == 1 ? 1 : CHANNELS + 1)

typedef struct {
    index unit;               /* -1: none */
    index done;               /* samples finished */
    real mean[TALLIED], excess[TALLIED];    /* of their scores; the mean is mean - excess */
    real m2[TALLIED];         /* sum of squared deviations from it */
    index steps;              /* over all samples */
    index truncated;          /* samples that reached the step cap */
    index nonfinite;          /* samples whose score is infinite or not a number; never left out */
} Tally;

static void tally_begin(Tally *tally, Path *path, const mask where)
{
    tally->done = choose(where, (index)0, tally->done);
    for (int i = 0; i < TALLIED; ++i) {
        tally->mean[i] = choose(where, (real)0, tally->mean[i]);
        tally->excess[i] = choose(where, (real)0, tally->excess[i]);
        tally->m2[i] = choose(where, (real)0, tally->m2[i]);
    }
    tally->steps = choose(where, (index)0, tally->steps);
    tally->truncated = choose(where, (index)0, tally->truncated);
    tally->nonfinite = choose(where, (index)0, tally->nonfinite);
    path->lookups = choose(where, (index)0, path->lookups);
    path->crossings = choose(where, (index)0, path->crossings);
    path->violations = choose(where, (index)0, path->violations);
}

/* Lanes `ended` have one more score x, the done-th. */
static void tally_score(Tally *tally, const int i, const real x, const mask ended)
{
    const real deviation = x - tally->mean[i] + tally->excess[i];
    const real rise = deviation / to_real(tally->done) - tally->excess[i];
    const real mean = tally->mean[i] + rise;
    const real excess = mean - tally->mean[i] - rise;
    tally->m2[i] = choose(ended, tally->m2[i] + deviation * (x - mean + excess), tally->m2[i]);
    tally->excess[i] = choose(ended, excess, tally->excess[i]);
    tally->mean[i] = choose(ended, mean, tally->mean[i]);
}

static void tally_sample(Tally *tally, const Path *path, const mask ended, const mask truncated)
{
    tally->done -= ended;
    tally->steps += ended & path->steps;
    tally->truncated -= truncated;
    real sum = (real)0;
    for (int c = 0; c < CHANNELS; ++c) {
        const real x = score_of(path, c);
        tally_score(tally, c, x, ended);
        sum += x;
    }
    if (TALLIED > CHANNELS)
        tally_score(tally, TALLIED - 1, sum / (SCALAR)CHANNELS, ended);
    /* an infinite score makes the sum infinite, or no number */
    tally->nonfinite -= ended & ~less(fabs(sum), (real)INFINITY);
}

/* The results of the units that lanes `where` have finished, in the order of the host's COUNTERS. */
static void tally_store(const Tally *tally, const Path *path, const mask where, __global SCALAR *moments,
                        __global uint *counters)
{
    INTEGER finished[LANES], unit[LANES], values[6][LANES];
    SCALAR parts[TALLIED][3][LANES];
    store_lanes(where & ~less(tally->unit, (index)0), finished);
    store_lanes(tally->unit, unit);
    for (int i = 0; i < TALLIED; ++i) {
        store_lanes(tally->mean[i], parts[i][0]);
        store_lanes(tally->excess[i], parts[i][1]);
        store_lanes(tally->m2[i], parts[i][2]);
    }
    store_lanes(path->lookups, values[0]);
    store_lanes(path->crossings, values[1]);
    store_lanes(path->violations, values[2]);
    store_lanes(tally->steps, values[3]);
    store_lanes(tally->truncated, values[4]);
    store_lanes(tally->nonfinite, values[5]);
    for (int lane = 0; lane < LANES; ++lane) {
        if (!finished[lane])
            continue;
        for (int i = 0; i < 3 * TALLIED; ++i)
            moments[3 * TALLIED * unit[lane] + i] = parts[i / 3][i % 3][lane];
        for (int i = 0; i < 6; ++i)
            counters[6 * unit[lane] + i] = (uint)values[i][lane];
    }
}
