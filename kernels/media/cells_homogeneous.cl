/*---
title: The one cell of a homogeneous medium
uses: [media/cells_constant]
---*/
static void cells_begin(Path *path, const Scene *scene) {}

static real cell_exit(const Path *path, const Scene *scene) { return path->ray.length; }

static Cell cell_between(Path *path, const Scene *scene, const real t_enter, const real t_exit, const mask here)
{
    const Cell cell = {sigma_t(path, scene, t_enter, here)};
    return cell;
}

static void cell_cross(Path *path, const mask where) {}
