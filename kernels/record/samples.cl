/* Every sample is kept: where it ended, its weight, whether it escaped, the lookups of its unit so far, and
   its score. */
static void record(const Tally *tally, const Path *path, const mask ended, const uint samples,
                   __global SCALAR *recorded)
{
    INTEGER over[LANES], unit[LANES], number[LANES], escaped[LANES], lookups[LANES];
    SCALAR t[LANES], weight[LANES], scores[LANES];
    store_lanes(ended, over);
    store_lanes(tally->unit, unit);
    store_lanes(tally->done, number);
    store_lanes(path->escaped, escaped);
    store_lanes(path->lookups, lookups);
    store_lanes(path->t, t);
    store_lanes(path->weight, weight);
    store_lanes(path->collected + score(path->weight, path->t, path->escaped), scores);
    for (int lane = 0; lane < LANES; ++lane) {
        if (!over[lane])
            continue;
        __global SCALAR *sample = recorded + 5 * ((ulong)unit[lane] * samples + (ulong)(number[lane] - 1));
        sample[0] = t[lane];
        sample[1] = weight[lane];
        sample[2] = escaped[lane] ? (SCALAR)1 : (SCALAR)0;
        sample[3] = (SCALAR)lookups[lane];
        sample[4] = scores[lane];
    }
}
