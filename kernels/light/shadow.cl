/* A shadow ray's tracker estimates transmittance, whatever paths collect: these stand for its functions of the same
   names without `shadow_`. */
static real shadow_sampled_depth(Rng *rng) { return (real)FAR; }

static void shadow_splat(Path *path, const real weight, const real t, const mask escaped, const mask where)
{
    Path part = *path;
    part.weight = weight;
    for (int c = 0; c < CHANNELS; ++c)
        collect(path, c, weight_of(&part, c), where & escaped);
}

static void shadow_escape_through_depth(Path *path, const mask where)
{
    path->weight = choose(where, path->weight * exp(-path->depth), path->weight);
    escape(path, where);
}
