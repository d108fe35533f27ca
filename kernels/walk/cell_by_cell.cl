/*---
title: Entering the cells that a walk goes through
---*/
static void enter_cell(Path *path, const Scene *scene, const mask entering)
{
    const real majorant = cell_majorant(path, scene);
    path->majorant = choose(entering, majorant, path->majorant);
    path->mean_free_path = choose(less((real)0, path->majorant), (SCALAR)1 / path->majorant, (real)FAR);
}

static void walk_begin(Path *path, const Scene *scene)
{
    cells_enter(path, scene);
    enter_cell(path, scene, (mask)-1);
}

static void enter_next_cell(Path *path, const Scene *scene, const real plane, const mask crossing)
{
    cross_plane(path, scene, plane, crossing);
    enter_cell(path, scene, crossing);
}
