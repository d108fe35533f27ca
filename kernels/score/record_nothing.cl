/* Only means and counts are kept. */
static void record(const Tally *tally, const Path *path, const mask ended, const uint samples, __global SCALAR *recorded)
{
}
