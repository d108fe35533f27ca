/*---
title: The walk through the leaves of an octree of majorants
uses: [walk/in_cells]
state: {cell: Indices, leaf_size: index, plane_pace: Vector, leaf_exits: Vector}
---*/
/* The leaves are stored in a grid of the finest cells, each with the size of its leaf: finding a neighbour is
   one load and no descent. majorant_data has majorants, sizes and, where there are any, controls. What holds for
   the whole ray (the distance from plane to plane) and for the whole leaf (its size, where the ray leaves it along
   each axis) is kept: that took a tenth to a third off the time of a sample. */
static real cell_value(const Path *path, const Scene *scene, const int layer)
{
    const INTEGER n = (INTEGER)scene->majorant.resolution;
    const State *walk = &path->state;
    const index cell = (walk->cell.z * n + walk->cell.y) * n + walk->cell.x;
    return gather(scene->majorant_data + layer * (int)scene->majorant.cells, cell);
}

static real cell_majorant(const Path *path, const Scene *scene) { return cell_value(path, scene, 0); }

static real cell_control(const Path *path, const Scene *scene) { return cell_value(path, scene, 2); }

/* The finest cell that the ray starts in along an axis, and the distance between planes: 0 where none is met, as
   the ray is along them or rounding keeps it where it is. */
static real enter_axis(const real where, const real velocity, const real length, const SCALAR resolution, index *cell)
{
    *cell = clamp(to_index(where), (index)0, (index)((INTEGER)resolution - 1));
    const mask flat = equal(where + velocity * length, where);
    return choose(flat, (real)0, (SCALAR)1 / choose(flat, (real)1, velocity));
}

/* The first finest cell of the leaf along an axis; sizes are powers of two. */
static index leaf_start(const index cell, const index size) { return cell & -size; }

/* Where the ray leaves the leaf along an axis. The planes of the box itself are never met: the end of the ray
   is, and rounding must not lead to a cell beyond. */
static real leaf_exit(const real t, const index cell, const index size, const real where, const real pace,
                      const SCALAR resolution)
{
    const mask forward = less((real)0, pace);
    const index plane = leaf_start(cell, size) + choose(forward, size, (index)0);
    const mask last = equal(plane, choose(forward, (index)(INTEGER)resolution, (index)0));
    const real exit = (to_real(plane) - where) * pace;
    const real onward = larger(exit, t);
    return choose(last | equal(pace, (real)0), (real)FAR, onward);
}

/* In the leaf that its finest cell belongs to. */
static void enter_leaf(Path *path, const Scene *scene, const mask entering)
{
    State *walk = &path->state;
    const SCALAR n = scene->majorant.resolution;
    const index size = to_index(cell_value(path, scene, 1));
    const Vector where = in_cells(path->ray.origin, scene);
    const Vector exit = {leaf_exit(path->t, walk->cell.x, size, where.x, walk->plane_pace.x, n),
                         leaf_exit(path->t, walk->cell.y, size, where.y, walk->plane_pace.y, n),
                         leaf_exit(path->t, walk->cell.z, size, where.z, walk->plane_pace.z, n)};
    walk->leaf_size = choose(entering, size, walk->leaf_size);
    take_vector(&walk->leaf_exits, &exit, entering);
}

static void cells_enter(Path *path, const Scene *scene)
{
    State *walk = &path->state;
    const SCALAR n = scene->majorant.resolution;
    const real length = path->ray.length;
    const Vector where = in_cells(path->ray.origin, scene), velocity = in_cells(path->ray.direction, scene);
    walk->plane_pace.x = enter_axis(where.x, velocity.x, length, n, &walk->cell.x);
    walk->plane_pace.y = enter_axis(where.y, velocity.y, length, n, &walk->cell.y);
    walk->plane_pace.z = enter_axis(where.z, velocity.z, length, n, &walk->cell.z);
    enter_leaf(path, scene, (mask)-1);
}

static real next_plane(const Path *path, const Scene *scene) { return least_of(path->state.leaf_exits); }

/* Along the axes whose plane is met the next cell follows from the leaf, exactly, so a walk cannot stall; along
   the others it is where the ray is, held inside the leaf. */
static index next_cell(const index cell, const index size, const real plane, const real exit, const real pace,
                       const real where)
{
    const index start = leaf_start(cell, size);
    const index within = clamp(to_index(where), start, start + size - 1);
    const index beyond = choose(less((real)0, pace), start + size, start - 1);
    return choose(~less(plane, exit), beyond, within);
}

static void cross_plane(Path *path, const Scene *scene, const real plane, const mask crossing)
{
    State *walk = &path->state;
    const index size = walk->leaf_size;
    const Vector where = in_cells(place_on(&path->ray, plane), scene);
    const Indices next = {next_cell(walk->cell.x, size, plane, walk->leaf_exits.x, walk->plane_pace.x, where.x),
                          next_cell(walk->cell.y, size, plane, walk->leaf_exits.y, walk->plane_pace.y, where.y),
                          next_cell(walk->cell.z, size, plane, walk->leaf_exits.z, walk->plane_pace.z, where.z)};
    take_indices(&walk->cell, &next, crossing);
    enter_leaf(path, scene, crossing);
    count(path->crossings, crossing);
}
