/* What is collected, of paths of several channels. */
static void collect(Path *path, const int channel, const real value, const mask where)
{
    real *sum = &path->state.collected[channel];
    *sum = choose(where, *sum + value, *sum);
}
