/*---
title: The walk through the leaves of an octree of majorants
state:
  cell_x: index
  cell_y: index
  cell_z: index
---*/
/* The leaves are stored in a grid of the finest cells, each with the size of its leaf: finding a neighbour is
   one load and no descent. majorant_data has majorants, sizes and, where there are any, controls. */
static real cell_value(const Path *path, const Scene *scene, const int layer)
{
    const INTEGER n = (INTEGER)scene->majorant.resolution;
    const State *walk = &path->state;
    const index cell = (walk->cell_z * n + walk->cell_y) * n + walk->cell_x;
    return gather(scene->majorant_data + layer * (int)scene->majorant.cells, cell);
}

static real cell_majorant(const Path *path, const Scene *scene) { return cell_value(path, scene, 0); }

static real cell_control(const Path *path, const Scene *scene) { return cell_value(path, scene, 2); }

static index finest_cell(const real x, const SCALAR per_length, const SCALAR resolution)
{
    return clamp(to_index(x * per_length), (index)0, (index)((INTEGER)resolution - 1));
}

static void cells_enter(Path *path, const Scene *scene)
{
    const SCALAR n = scene->majorant.resolution;
    path->state.cell_x = finest_cell(path->origin_x, scene->majorant.cells_per_x, n);
    path->state.cell_y = finest_cell(path->origin_y, scene->majorant.cells_per_y, n);
    path->state.cell_z = finest_cell(path->origin_z, scene->majorant.cells_per_z, n);
}

/* The first finest cell of the leaf along an axis; sizes are powers of two. */
static index leaf_start(const index cell, const index size) { return cell & -size; }

/* Where the ray leaves the leaf along an axis. The planes of the box itself are never met: the end of the ray
   is, and rounding must not lead to a cell beyond. */
static real leaf_plane(const Path *path, const index cell, const index size, const real origin,
                       const real direction, const SCALAR per_length, const SCALAR resolution)
{
    const mask forward = less((real)0, direction);
    const index plane = leaf_start(cell, size) + choose(forward, size, (index)0);
    const mask last = equal(plane, choose(forward, (index)(INTEGER)resolution, (index)0));
    const mask flat = equal(direction, (real)0) | last;
    const real t = (to_real(plane) - origin * per_length) / (choose(flat, (real)1, direction) * per_length);
    const real onward = larger(t, path->t);
    return choose(flat, (real)FAR, onward);
}

static real next_plane(const Path *path, const Scene *scene)
{
    const State *walk = &path->state;
    const SCALAR n = scene->majorant.resolution;
    const index size = to_index(cell_value(path, scene, 1));
    const real x = leaf_plane(path, walk->cell_x, size, path->origin_x, path->direction_x, scene->majorant.cells_per_x, n);
    const real y = leaf_plane(path, walk->cell_y, size, path->origin_y, path->direction_y, scene->majorant.cells_per_y, n);
    const real z = leaf_plane(path, walk->cell_z, size, path->origin_z, path->direction_z, scene->majorant.cells_per_z, n);
    const real nearer = smaller(x, y);
    return smaller(nearer, z);
}

/* Along the axes whose plane is met the next cell follows from the leaf, exactly, so a walk cannot stall; along
   the others it is where the ray is, held inside the leaf. */
static index next_cell(const Path *path, const index cell, const index size, const real origin, const real direction,
                       const real plane, const SCALAR per_length, const SCALAR resolution)
{
    const index start = leaf_start(cell, size);
    const mask crossed = ~less(plane, leaf_plane(path, cell, size, origin, direction, per_length, resolution));
    const index beyond = choose(less((real)0, direction), start + size, start - 1);
    const index within = clamp(to_index((origin + plane * direction) * per_length), start, start + size - 1);
    return clamp(choose(crossed, beyond, within), (index)0, (index)((INTEGER)resolution - 1));
}

static void cross_plane(Path *path, const Scene *scene, const real plane, const mask crossing)
{
    State *walk = &path->state;
    const SCALAR n = scene->majorant.resolution;
    const index size = to_index(cell_value(path, scene, 1));
    const index x = next_cell(path, walk->cell_x, size, path->origin_x, path->direction_x, plane, scene->majorant.cells_per_x, n);
    const index y = next_cell(path, walk->cell_y, size, path->origin_y, path->direction_y, plane, scene->majorant.cells_per_y, n);
    const index z = next_cell(path, walk->cell_z, size, path->origin_z, path->direction_z, plane, scene->majorant.cells_per_z, n);
    walk->cell_x = choose(crossing, x, walk->cell_x);
    walk->cell_y = choose(crossing, y, walk->cell_y);
    walk->cell_z = choose(crossing, z, walk->cell_z);
    count(path->crossings, crossing);
}
