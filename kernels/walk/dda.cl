/*---
title: Walk through the cells of a regular grid (Amanatides and Woo 1987)
state: {first_plane: Vector, plane_gap: Vector, planes_crossed: Vector}
---*/
/* The n-th plane of an axis is met at first + n gap: one rounding however many were crossed, where a
   running sum would drift. A ray along a plane never meets that axis (FAR), nor does one that rounding
   keeps where it is over all of its length: lookups stay in the cell that it starts in. Where planes are
   met at the same t (edges, corners) all of their axes step at once, so no cell of zero length is
   visited. */
static void dda_axis(const real where, const real velocity, const real length, const SCALAR cells,
                     index *cell, real *first, real *gap)
{
    *cell = clamp(to_index(where), (index)0, (index)((INTEGER)cells - 1));
    const mask forward = less((real)0, velocity);
    const real speed = choose(forward, velocity, -velocity);
    const real rest = choose(forward, to_real(*cell) + (SCALAR)1 - where, where - to_real(*cell));
    const mask flat = equal(where + velocity * length, where);
    const real pace = smaller((SCALAR)1 / choose(flat, (real)1, speed), (real)FAR);
    *first = choose(flat, (real)FAR, rest * pace);
    *gap = choose(flat, (real)0, pace);
}

/* Start a walk at a place in cells, through so many along each axis; returns the cell there. */
static Indices dda_begin(Path *path, const Vector where, const Vector velocity, const SCALAR nx, const SCALAR ny,
                         const SCALAR nz)
{
    State *walk = &path->state;
    Indices cell;
    dda_axis(where.x, velocity.x, path->ray.length, nx, &cell.x, &walk->first_plane.x, &walk->plane_gap.x);
    dda_axis(where.y, velocity.y, path->ray.length, ny, &cell.y, &walk->first_plane.y, &walk->plane_gap.y);
    dda_axis(where.z, velocity.z, path->ray.length, nz, &cell.z, &walk->first_plane.z, &walk->plane_gap.z);
    walk->planes_crossed.x = walk->planes_crossed.y = walk->planes_crossed.z = (real)0;
    return cell;
}

static Vector dda_next(const State *walk)
{
    const Vector first = walk->first_plane, n = walk->planes_crossed, gap = walk->plane_gap;
    const Vector next = {first.x + n.x * gap.x, first.y + n.y * gap.y, first.z + n.z * gap.z};
    return next;
}

/* Where the ray meets the next plane of the grid. */
static real dda_plane(const Path *path) { return least_of(dda_next(&path->state)); }

/* Lanes `where` cross the plane; returns along which axes they enter another cell, as masks. */
static Indices dda_cross(Path *path, const real plane, const mask where)
{
    State *walk = &path->state;
    const Vector next = dda_next(walk);
    const Indices crossed = {where & ~less(plane, next.x), where & ~less(plane, next.y), where & ~less(plane, next.z)};
    walk->planes_crossed.x -= to_real(crossed.x);
    walk->planes_crossed.y -= to_real(crossed.y);
    walk->planes_crossed.z -= to_real(crossed.z);
    count(path->crossings, where);
    return crossed;
}
