/* A voxel grid, constant in each voxel. Medium coordinates count voxels. */
static index voxel_of(const real x, const SCALAR voxels)
{
    return clamp(to_index(x), (index)0, (index)((INTEGER)voxels - 1));
}

static real sigma_t_at(const Scene *scene, const real x, const real y, const real z)
{
    const index i = voxel_of(x, scene->medium.nx);
    const index j = voxel_of(y, scene->medium.ny);
    const index k = voxel_of(z, scene->medium.nz);
    const INTEGER row = (INTEGER)scene->medium.nx, slice = row * (INTEGER)scene->medium.ny;
    return gather(scene->medium_data, k * slice + j * row + i);
}
