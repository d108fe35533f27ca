/* Every sample is kept: where it ended, its weight, whether it escaped, the lookups of its unit so far, and
   its score; then weight and score of each further channel. */
#define RECORDED (3 + 2 * CHANNELS)

static void record(const Tally *tally, const Path *path, const mask ended, const uint samples,
                   __global SCALAR *recorded)
{
    INTEGER over[LANES], unit[LANES], number[LANES], escaped[LANES], lookups[LANES];
    SCALAR t[LANES], weights[CHANNELS][LANES], scores[CHANNELS][LANES];
    store_lanes(ended, over);
    store_lanes(tally->unit, unit);
    store_lanes(tally->done, number);
    store_lanes(path->escaped, escaped);
    store_lanes(path->lookups, lookups);
    store_lanes(path->t, t);
    for (int c = 0; c < CHANNELS; ++c) {
        store_lanes(weight_of(path, c), weights[c]);
        store_lanes(score_of(path, c), scores[c]);
    }
    for (int lane = 0; lane < LANES; ++lane) {
        if (!over[lane])
            continue;
        __global SCALAR *sample = recorded + RECORDED * ((ulong)unit[lane] * samples + (ulong)(number[lane] - 1));
        sample[0] = t[lane];
        sample[1] = weights[0][lane];
        sample[2] = escaped[lane] ? (SCALAR)1 : (SCALAR)0;
        sample[3] = (SCALAR)lookups[lane];
        sample[4] = scores[0][lane];
        for (int c = 1; c < CHANNELS; ++c) {
            sample[3 + 2 * c] = weights[c][lane];
            sample[4 + 2 * c] = scores[c][lane];
        }
    }
}
