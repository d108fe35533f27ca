/*---
title: The voxels of a grid without interpolation
uses: [cells/constant, walk/dda]
---*/
static void cells_begin(Path *path, const Scene *scene)
{
    index cell;
    State *walk = &path->state;
    dda_axis(path->origin_x, path->direction_x, path->length, scene->medium.nx, &cell,
             &walk->first_x, &walk->delta_x);
    dda_axis(path->origin_y, path->direction_y, path->length, scene->medium.ny, &cell,
             &walk->first_y, &walk->delta_y);
    dda_axis(path->origin_z, path->direction_z, path->length, scene->medium.nz, &cell,
             &walk->first_z, &walk->delta_z);
    dda_begin(path);
}

static real cell_exit(const Path *path, const Scene *scene)
{
    const real plane = dda_plane(path);
    return smaller(plane, path->length);
}

/* The voxel is the one of the middle of its chord, where rounding cannot miss it. */
static Cell cell_between(Path *path, const Scene *scene, const real t_enter, const real t_exit, const mask here)
{
    const Cell cell = {sigma_t(path, scene, (SCALAR)0.5 * (t_enter + t_exit), here)};
    return cell;
}

static void cell_cross(Path *path, const mask where)
{
    dda_cross(path, path->t, where);
}
