/*---
title: The cells between the voxel centres of a trilinear grid
uses: [media/cells_by_dda, math/newton]
---*/
/* Between eight voxel centres the extinction along a ray is a cubic of the distance, so its optical depth
   is a quartic, exactly. The planes lie at i + 1/2. The cubic is one of the share of the cell's span: of the
   distance its coefficients would vanish in float where a length unit is small against a voxel. */
typedef struct {
    real c0, c1, c2, c3;
    real per_span;
} Cell;

static void cells_begin(Path *path, const Scene *scene)
{
    const Vector at = path->ray.origin;
    const Vector where = {at.x + (SCALAR)0.5, at.y + (SCALAR)0.5, at.z + (SCALAR)0.5};
    dda_begin(path, where, path->ray.direction, scene->medium.nx + 1, scene->medium.ny + 1, scene->medium.nz + 1);
}

/* Along one axis: the voxel below, where in its interval the path enters, and how far it gets there.
   Beyond the outermost centres nothing changes along the axis. */
static index cell_axis(const real origin, const real direction, const real t_enter, const real span,
                       const SCALAR voxels, real *start, real *rise)
{
    const real middle = origin + (t_enter + (SCALAR)0.5 * span) * direction - (SCALAR)0.5;
    const index below = voxel_below(middle, voxels);
    const mask outside = less(middle, (real)0) | less((real)(voxels - 1), middle);
    *start = saturate(origin + t_enter * direction - (SCALAR)0.5 - to_real(below));
    *start = choose(outside, saturate(middle - to_real(below)), *start);
    *rise = choose(outside, (real)0, direction * span);
    return below;
}

static Cell cell_between(Path *path, const Scene *scene, const real t_enter, const real t_exit, const mask here)
{
    count(path->lookups, here);
    const real span = t_exit - t_enter;
    real x, y, z, dx, dy, dz;
    const index i = cell_axis(path->ray.origin.x, path->ray.direction.x, t_enter, span, scene->medium.nx, &x, &dx);
    const index j = cell_axis(path->ray.origin.y, path->ray.direction.y, t_enter, span, scene->medium.ny, &y, &dy);
    const index k = cell_axis(path->ray.origin.z, path->ray.direction.z, t_enter, span, scene->medium.nz, &z, &dz);
    const INTEGER row = (INTEGER)scene->medium.nx, slice = row * (INTEGER)scene->medium.ny;
    const index voxel = k * slice + j * row + i;
    /* Interpolation along x gives lines, along y quadratics, along z the cubic. */
    real quadratic[2][3];
    for (int upper = 0; upper < 2; ++upper) {
        __global const float *at = scene->medium_data + upper * slice;
        const real a = gather(at, voxel), rise_a = gather(at + 1, voxel) - a;
        const real b = gather(at + row, voxel), rise_b = gather(at + row + 1, voxel) - b;
        const real line_0 = a + x * rise_a, line_1 = dx * rise_a;
        const real gap_0 = b + x * rise_b - line_0, gap_1 = dx * rise_b - line_1;
        quadratic[upper][0] = line_0 + y * gap_0;
        quadratic[upper][1] = line_1 + y * gap_1 + dy * gap_0;
        quadratic[upper][2] = dy * gap_1;
    }
    const real gap_0 = quadratic[1][0] - quadratic[0][0];
    const real gap_1 = quadratic[1][1] - quadratic[0][1];
    const real gap_2 = quadratic[1][2] - quadratic[0][2];
    Cell cell;
    cell.c0 = quadratic[0][0] + z * gap_0;
    cell.c1 = quadratic[0][1] + z * gap_1 + dz * gap_0;
    cell.c2 = quadratic[0][2] + z * gap_2 + dz * gap_1;
    cell.c3 = dz * gap_2;
    const mask some = less((real)0, span);
    cell.per_span = choose(some, (SCALAR)1 / choose(some, span, (real)1), (real)0);
    return cell;
}

static real cell_depth(const Cell cell, const real s)
{
    const real third = (SCALAR)1 / (SCALAR)3;
    const real u = s * cell.per_span;
    return s * (cell.c0 + u * ((SCALAR)0.5 * cell.c1 + u * (third * cell.c2 + u * ((SCALAR)0.25 * cell.c3))));
}

/* Lanes whose depth is beyond the cell find its end at once, and do not keep the others waiting. */
static real cell_distance(const Cell cell, const real depth, const real length)
{
    const real total = cell_depth(cell, length);
    const real wanted = smaller(depth, total);
    Bracket bracket = {(real)0, length, length * wanted / total, (real)FAR};
    for (int i = 0; i < NEWTON_STEPS; ++i) {
        const real s = bracket.at;
        const real u = s * cell.per_span;
        const real sigma = cell.c0 + u * (cell.c1 + u * (cell.c2 + u * cell.c3));
        if (!any_lane(newton(&bracket, cell_depth(cell, s) - wanted, sigma)))
            break;
    }
    return bracket.at;
}
