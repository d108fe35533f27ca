/*---
title: The walk through a regular grid of majorants, by DDA
uses: [walk/dda, walk/in_cells]
state: {cell: index, stride: Indices}
---*/
/* majorant_data has one more layer of cells on every side, a copy of its neighbour: a plane that rounding
   puts just inside the end of the ray leads there and not into another row. */
static real cell_majorant(const Path *path, const Scene *scene)
{
    return gather(scene->majorant_data, path->state.cell);
}

static real cell_control(const Path *path, const Scene *scene)
{
    return gather(scene->majorant_data + (int)scene->majorant.cells, path->state.cell);
}

static void cells_enter(Path *path, const Scene *scene)
{
    State *walk = &path->state;
    const INTEGER row = (INTEGER)scene->majorant.nx + 2;
    const INTEGER slice = row * ((INTEGER)scene->majorant.ny + 2);
    const Indices at = dda_begin(path, in_cells(path->ray.origin, scene), in_cells(path->ray.direction, scene),
                                 scene->majorant.nx, scene->majorant.ny, scene->majorant.nz);
    walk->cell = (at.z + 1) * slice + (at.y + 1) * row + (at.x + 1);
    walk->stride.x = choose(less(path->ray.direction.x, (real)0), (index)-1, (index)1);
    walk->stride.y = choose(less(path->ray.direction.y, (real)0), (index)-row, (index)row);
    walk->stride.z = choose(less(path->ray.direction.z, (real)0), (index)-slice, (index)slice);
}

static real next_plane(const Path *path, const Scene *scene) { return dda_plane(path); }

static void cross_plane(Path *path, const Scene *scene, const real plane, const mask crossing)
{
    State *walk = &path->state;
    const Indices crossed = dda_cross(path, plane, crossing);
    walk->cell += (crossed.x & walk->stride.x) + (crossed.y & walk->stride.y) + (crossed.z & walk->stride.z);
}
