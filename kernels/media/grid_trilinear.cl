/* A voxel grid, interpolated between voxel centres (at i + 1/2) and constant beyond the outermost ones.
   Medium coordinates count voxels. Every axis has at least two voxels: the host doubles a single one. */
static real mix_lanes(const real a, const real b, const real f) { return a + (b - a) * f; }

static index voxel_below(const real u, const SCALAR voxels)
{
    return clamp(to_index(u), (index)0, (index)((INTEGER)voxels - 2));
}

static real sigma_t_at(const Scene *scene, const real x, const real y, const real z)
{
    const real u = x - (SCALAR)0.5, v = y - (SCALAR)0.5, w = z - (SCALAR)0.5;
    const index i = voxel_below(u, scene->medium.nx);
    const index j = voxel_below(v, scene->medium.ny);
    const index k = voxel_below(w, scene->medium.nz);
    const real fx = saturate(u - to_real(i)), fy = saturate(v - to_real(j)), fz = saturate(w - to_real(k));
    const INTEGER row = (INTEGER)scene->medium.nx, slice = row * (INTEGER)scene->medium.ny;
    const index voxel = k * slice + j * row + i;
    __global const float *at = scene->medium_data;
    const real low_0 = mix_lanes(gather(at, voxel), gather(at + 1, voxel), fx);
    const real low_1 = mix_lanes(gather(at + row, voxel), gather(at + row + 1, voxel), fx);
    at += slice;
    const real high_0 = mix_lanes(gather(at, voxel), gather(at + 1, voxel), fx);
    const real high_1 = mix_lanes(gather(at + row, voxel), gather(at + row + 1, voxel), fx);
    return mix_lanes(mix_lanes(low_0, low_1, fy), mix_lanes(high_0, high_1, fy), fz);
}
