/*---
title: The voxels of a grid without interpolation
uses: [media/cells_constant, media/cells_by_dda]
---*/
static void cells_begin(Path *path, const Scene *scene)
{
    dda_begin(path, path->ray.origin, path->ray.direction, scene->medium.nx, scene->medium.ny, scene->medium.nz);
}

/* The voxel is the one of the middle of its chord, where rounding cannot miss it. */
static Cell cell_between(Path *path, const Scene *scene, const real t_enter, const real t_exit, const mask here)
{
    const Cell cell = {sigma_t(path, scene, (SCALAR)0.5 * (t_enter + t_exit), here)};
    return cell;
}
