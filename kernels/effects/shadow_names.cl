/* The tracker that follows estimates the transmittance of shadow rays, whatever paths collect. */
#define SHADOW_STEPS (1 << 20)

static real shadow_depth(Rng *rng) { return (real)FAR; }

static void shadow_deposit(Path *path, const real weight, const real t, const mask escaped, const mask where)
{
    Path part = *path;
    part.weight = weight;
    for (int c = 0; c < CHANNELS; ++c)
        collect(path, c, weight_of(&part, c), where & escaped);
}

static void shadow_escape(Path *path, const mask where)
{
    path->weight = choose(where, path->weight * exp(-path->depth), path->weight);
    escape(path, where);
}

#undef begin
#undef step
#define begin(path, scene, rng) shadow_begin(path, scene, rng)
#define step(path, scene, rng) shadow_step(path, scene, rng)
#define sampled_depth(rng) shadow_depth(rng)
#define deposit(path, weight, t, escaped, where) shadow_deposit(path, weight, t, escaped, where)
#define escape_through_depth(path, where) shadow_escape(path, where)
#define tracker shadow_tracker
