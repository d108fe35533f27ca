/* What is collected of a flight is its length. */
static void collect_length(Path *path, const mask ended)
{
    for (int c = 0; c < CHANNELS; ++c)
        collect(path, c, weight_of(path, c) * path->t, ended);
}
