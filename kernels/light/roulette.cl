/* Russian roulette: a path goes on with a chance equal to its largest weight, where that is below 1, and its
   weights are divided by it. Returns the lanes that end. */
static mask roulette(Path *path, const Scene *scene, Rng *rng, const mask on)
{
    real largest = fabs(weight_of(path, 0));
    for (int c = 1; c < CHANNELS; ++c) {
        const real other = fabs(weight_of(path, c));
        largest = larger(largest, other);
    }
    const mask playing = on & less(largest, (real)1);
    const mask ended = playing & ~less(uniform(rng), largest);
    path->weight = choose(playing & ~ended, path->weight / largest, path->weight);
    return ended;
}
