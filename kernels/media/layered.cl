/* Layers of constant extinction, a stack along z. data: a value a layer, then the boundaries from 0 to
   the height. */
static index layer_at(const Scene *scene, const real z)
{
    const int layers = (int)scene->medium.layers;
    index layer = (index)0;
    for (int inner = 1; inner < layers; ++inner)
        layer -= ~less(z, (real)(SCALAR)scene->medium_data[layers + inner]);
    return layer;
}

static real sigma_t_at(const Scene *scene, const real x, const real y, const real z)
{
    return gather(scene->medium_data, layer_at(scene, z));
}
