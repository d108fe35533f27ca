/*---
title: The walk through a regular grid of majorants, by DDA
uses: [walk/dda]
state:
  cell: index
  stride_x: index
  stride_y: index
  stride_z: index
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
    index i, j, k;
    dda_axis(path->origin_x * scene->majorant.cells_per_x, path->direction_x * scene->majorant.cells_per_x,
             path->length, scene->majorant.nx, &i, &walk->first_x, &walk->delta_x);
    dda_axis(path->origin_y * scene->majorant.cells_per_y, path->direction_y * scene->majorant.cells_per_y,
             path->length, scene->majorant.ny, &j, &walk->first_y, &walk->delta_y);
    dda_axis(path->origin_z * scene->majorant.cells_per_z, path->direction_z * scene->majorant.cells_per_z,
             path->length, scene->majorant.nz, &k, &walk->first_z, &walk->delta_z);
    walk->cell = (k + 1) * slice + (j + 1) * row + (i + 1);
    walk->stride_x = choose(less(path->direction_x, (real)0), (index)-1, (index)1);
    walk->stride_y = choose(less(path->direction_y, (real)0), (index)-row, (index)row);
    walk->stride_z = choose(less(path->direction_z, (real)0), (index)-slice, (index)slice);
    dda_begin(path);
}

static real next_plane(const Path *path, const Scene *scene) { return dda_plane(path); }

static void cross_plane(Path *path, const Scene *scene, const real plane, const mask crossing)
{
    State *walk = &path->state;
    const Crossed crossed = dda_cross(path, plane, crossing);
    walk->cell += (crossed.x & walk->stride_x) + (crossed.y & walk->stride_y) + (crossed.z & walk->stride_z);
}
