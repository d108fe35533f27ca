/*---
title: Walk through the cells of a regular grid (Amanatides and Woo 1987)
state:
  first_x: real
  first_y: real
  first_z: real
  delta_x: real
  delta_y: real
  delta_z: real
  crossed_x: real
  crossed_y: real
  crossed_z: real
---*/
/* The n-th plane of an axis is met at first + n delta: one rounding however many were crossed, where a
   running sum would drift. A ray along a plane never meets that axis (FAR), nor does one that rounding
   keeps where it is over all of its length: lookups stay in the cell that it starts in. Where planes are
   met at the same t (edges, corners) all of their axes step at once, so no cell of zero length is
   visited. */
static void dda_axis(const real where, const real velocity, const real length, const SCALAR cells,
                     index *cell, real *first, real *delta)
{
    *cell = clamp(to_index(where), (index)0, (index)((INTEGER)cells - 1));
    const mask forward = less((real)0, velocity);
    const real speed = choose(forward, velocity, -velocity);
    const real gap = choose(forward, to_real(*cell) + (SCALAR)1 - where, where - to_real(*cell));
    const mask flat = equal(where + velocity * length, where);
    const real pace = smaller((SCALAR)1 / choose(flat, (real)1, speed), (real)FAR);
    *first = choose(flat, (real)FAR, gap * pace);
    *delta = choose(flat, (real)0, pace);
}

static real dda_next_x(const Path *path)
{
    return path->state.first_x + path->state.crossed_x * path->state.delta_x;
}

static real dda_next_y(const Path *path)
{
    return path->state.first_y + path->state.crossed_y * path->state.delta_y;
}

static real dda_next_z(const Path *path)
{
    return path->state.first_z + path->state.crossed_z * path->state.delta_z;
}

static void dda_begin(Path *path)
{
    path->state.crossed_x = path->state.crossed_y = path->state.crossed_z = (real)0;
}

/* Where the ray meets the next plane of the grid. */
static real dda_plane(const Path *path)
{
    const real next_x = dda_next_x(path), next_y = dda_next_y(path), next_z = dda_next_z(path);
    const real nearer = smaller(next_x, next_y);
    return smaller(nearer, next_z);
}

typedef struct {
    mask x, y, z;
} Crossed;

/* Lanes `where` cross the plane; returns the axes along which they enter another cell. */
static Crossed dda_cross(Path *path, const real plane, const mask where)
{
    Crossed crossed;
    crossed.x = where & ~less(plane, dda_next_x(path));
    crossed.y = where & ~less(plane, dda_next_y(path));
    crossed.z = where & ~less(plane, dda_next_z(path));
    path->state.crossed_x -= to_real(crossed.x);
    path->state.crossed_y -= to_real(crossed.y);
    path->state.crossed_z -= to_real(crossed.z);
    count(path->crossings, where);
    return crossed;
}
