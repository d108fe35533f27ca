/* Weights and what is collected, of paths of one channel. */
static void scale_throughput(Path *path, const int channel, const real factor, const mask where)
{
    path->weight = choose(where, path->weight * factor, path->weight);
}

static void collect(Path *path, const int channel, const real value, const mask where)
{
    path->state.collected = choose(where, path->state.collected + value, path->state.collected);
}
