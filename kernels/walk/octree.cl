/*---
title: The walk through the leaves of an octree of majorants
state:
  cell_x: index
  cell_y: index
  cell_z: index
  leaf_size: index
  pace_x: real
  pace_y: real
  pace_z: real
  exit_x: real
  exit_y: real
  exit_z: real
---*/
/* The leaves are stored in a grid of the finest cells, each with the size of its leaf: finding a neighbour is
   one load and no descent. majorant_data has majorants, sizes and, where there are any, controls. What holds for
   the whole ray (the distance from plane to plane) and for the whole leaf (its size, where the ray leaves it along
   each axis) is kept: that took a tenth to a third off the time of a sample. */
static real cell_value(const Path *path, const Scene *scene, const int layer)
{
    const INTEGER n = (INTEGER)scene->majorant.resolution;
    const State *walk = &path->state;
    const index cell = (walk->cell_z * n + walk->cell_y) * n + walk->cell_x;
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
    const real where_x = path->origin_x * scene->majorant.cells_per_x;
    const real where_y = path->origin_y * scene->majorant.cells_per_y;
    const real where_z = path->origin_z * scene->majorant.cells_per_z;
    const real exit_x = leaf_exit(path->t, walk->cell_x, size, where_x, walk->pace_x, n);
    const real exit_y = leaf_exit(path->t, walk->cell_y, size, where_y, walk->pace_y, n);
    const real exit_z = leaf_exit(path->t, walk->cell_z, size, where_z, walk->pace_z, n);
    walk->leaf_size = choose(entering, size, walk->leaf_size);
    walk->exit_x = choose(entering, exit_x, walk->exit_x);
    walk->exit_y = choose(entering, exit_y, walk->exit_y);
    walk->exit_z = choose(entering, exit_z, walk->exit_z);
}

static void cells_enter(Path *path, const Scene *scene)
{
    State *walk = &path->state;
    const SCALAR n = scene->majorant.resolution;
    const SCALAR x = scene->majorant.cells_per_x, y = scene->majorant.cells_per_y, z = scene->majorant.cells_per_z;
    walk->pace_x = enter_axis(path->origin_x * x, path->direction_x * x, path->length, n, &walk->cell_x);
    walk->pace_y = enter_axis(path->origin_y * y, path->direction_y * y, path->length, n, &walk->cell_y);
    walk->pace_z = enter_axis(path->origin_z * z, path->direction_z * z, path->length, n, &walk->cell_z);
    enter_leaf(path, scene, (mask)-1);
}

static real next_plane(const Path *path, const Scene *scene)
{
    const State *walk = &path->state;
    const real nearer = smaller(walk->exit_x, walk->exit_y);
    return smaller(nearer, walk->exit_z);
}

/* Along the axes whose plane is met the next cell follows from the leaf, exactly, so a walk cannot stall; along
   the others it is where the ray is, held inside the leaf. */
static index next_cell(const index cell, const index size, const mask crossed, const mask forward, const real where)
{
    const index start = leaf_start(cell, size);
    const index within = clamp(to_index(where), start, start + size - 1);
    return choose(crossed, choose(forward, start + size, start - 1), within);
}

static void cross_plane(Path *path, const Scene *scene, const real plane, const mask crossing)
{
    State *walk = &path->state;
    const real x = (path->origin_x + plane * path->direction_x) * scene->majorant.cells_per_x;
    const real y = (path->origin_y + plane * path->direction_y) * scene->majorant.cells_per_y;
    const real z = (path->origin_z + plane * path->direction_z) * scene->majorant.cells_per_z;
    const index next_x =
        next_cell(walk->cell_x, walk->leaf_size, ~less(plane, walk->exit_x), less((real)0, walk->pace_x), x);
    const index next_y =
        next_cell(walk->cell_y, walk->leaf_size, ~less(plane, walk->exit_y), less((real)0, walk->pace_y), y);
    const index next_z =
        next_cell(walk->cell_z, walk->leaf_size, ~less(plane, walk->exit_z), less((real)0, walk->pace_z), z);
    walk->cell_x = choose(crossing, next_x, walk->cell_x);
    walk->cell_y = choose(crossing, next_y, walk->cell_y);
    walk->cell_z = choose(crossing, next_z, walk->cell_z);
    enter_leaf(path, scene, crossing);
    count(path->crossings, crossing);
}
