/* Layers: the sum over them of extinction times the length of the ray inside. */
static void layer_span(const Path *path, const Scene *scene, const index layer, real *enter, real *leave)
{
    __global const float *boundaries = scene->medium_data + (int)scene->medium.layers;
    const mask flat = equal(path->ray.direction.z, (real)0);
    const real divisor = choose(flat, (real)1, path->ray.direction.z);
    const real t_bottom = (gather(boundaries, layer) - path->ray.origin.z) / divisor;
    const real t_top = (gather(boundaries + 1, layer) - path->ray.origin.z) / divisor;
    const mask within = equal(layer_at(scene, path->ray.origin.z), layer);
    const real first = smaller(t_bottom, t_top), last = larger(t_bottom, t_top);
    *enter = choose(flat, (real)0, larger(first, (real)0));
    *leave = choose(flat, choose(within, path->ray.length, (real)0), last);
}

static real optical_depth(const Path *path, const Scene *scene, const real t)
{
    real depth = (real)0;
    for (int layer = 0; layer < (int)scene->medium.layers; ++layer) {
        real enter, leave;
        layer_span(path, scene, (index)layer, &enter, &leave);
        const real inside = smaller(leave, t) - enter;
        depth += scene->medium_data[layer] * larger(inside, (real)0);
    }
    return depth;
}

static real distance_to(const Path *path, const Scene *scene, const real depth)
{
    const int layers = (int)scene->medium.layers;
    const mask downwards = less(path->ray.direction.z, (real)0);
    real left = depth, distance = path->ray.length;
    mask searching = path->live;
    for (int i = 0; i < layers; ++i) {
        const index layer = choose(downwards, (index)(layers - 1 - i), (index)i);
        real enter, leave;
        layer_span(path, scene, layer, &enter, &leave);
        const real sigma = gather(scene->medium_data, layer);
        const real inside = smaller(leave, path->ray.length) - enter;
        const real here = sigma * larger(inside, (real)0);
        const mask found = searching & less(left, here);
        distance = choose(found, enter + left / sigma, distance);
        searching &= ~found;
        left -= here;
    }
    return distance;
}
