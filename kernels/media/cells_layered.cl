/*---
title: The layers of a stack
uses: [media/cells_constant]
state: {layer: index, upwards: index}
---*/
static void cells_begin(Path *path, const Scene *scene)
{
    path->state.layer = layer_at(scene, path->ray.origin.z);
    path->state.upwards = choose(less((real)0, path->ray.direction.z), (index)1, (index)0);
}

static real cell_exit(const Path *path, const Scene *scene)
{
    const mask flat = equal(path->ray.direction.z, (real)0);
    const index layers = (index)(INTEGER)scene->medium.layers;
    const index boundary = clamp(path->state.layer + path->state.upwards, (index)0, layers);
    /* The outermost boundaries are where the ray ends, also if rounding puts them a little before that. */
    const mask outermost = less(boundary, (index)1) | less(layers - 1, boundary);
    const real z = gather(scene->medium_data + (int)scene->medium.layers, boundary);
    const real t = (z - path->ray.origin.z) / choose(flat, (real)1, path->ray.direction.z);
    const real forward = larger(t, path->t);
    return choose(flat | outermost | less(path->ray.length, forward), path->ray.length, forward);
}

static Cell cell_between(Path *path, const Scene *scene, const real t_enter, const real t_exit, const mask here)
{
    count(path->lookups, here);
    const index layer = clamp(path->state.layer, (index)0, (index)((INTEGER)scene->medium.layers - 1));
    const Cell cell = {gather(scene->medium_data, layer)};
    return cell;
}

static void cell_cross(Path *path, const mask where)
{
    count(path->crossings, where);
    path->state.layer += where & (path->state.upwards * 2 - 1);
}
