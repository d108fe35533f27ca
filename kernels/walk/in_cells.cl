/* A place or a direction of the medium, counted in cells of majorants. */
static Vector in_cells(const Vector v, const Scene *scene)
{
    const Vector cells = {v.x * scene->majorant.cells_per_x, v.y * scene->majorant.cells_per_y,
                          v.z * scene->majorant.cells_per_z};
    return cells;
}
