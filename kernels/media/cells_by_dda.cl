/*---
title: Where cells end that are those of a regular grid
uses: [walk/dda]
---*/
static real cell_exit(const Path *path, const Scene *scene)
{
    const real plane = dda_plane(path);
    return smaller(plane, path->ray.length);
}

static void cell_cross(Path *path, const mask where) { dda_cross(path, path->t, where); }
