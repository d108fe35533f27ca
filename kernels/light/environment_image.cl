/* Light from outside as an image has it in each direction: latitude from +z at its top to -z, longitude with +x in
   the middle and +y to the left of it. Bilinear; a row beyond each pole makes the values meet there. */
static void see_image(Path *path, const Scene *scene, const mask gone)
{
    if (!any_lane(gone))
        return;
    const Vector ahead = mapped(scene->space.to_world, path->ray.direction);
    const real off = ahead.x * ahead.x + ahead.y * ahead.y;
    const real x = choose(equal(off, (real)0), (real)1, ahead.x);
    const real u = ((SCALAR)0.5 - (SCALAR)0.5 * atan2pi(ahead.y, x)) * (SCALAR)SKY_COLUMNS;
    const real across = u + (SCALAR)(SKY_COLUMNS - 0.5);
    const real down = atan2pi(sqrt(off), ahead.z) * (SCALAR)SKY_ROWS + (SCALAR)0.5;
    const index column = to_index(across);
    const index left = column % (index)SKY_COLUMNS, right = (column + (index)1) % (index)SKY_COLUMNS;
    const index row = clamp(to_index(down), (index)0, (index)SKY_ROWS);
    const index upper = row * (index)SKY_COLUMNS, lower = upper + (index)SKY_COLUMNS;
    const real share_right = across - to_real(column), share_lower = down - to_real(row);
    for (int c = 0; c < CHANNELS; ++c) {
        __global const float *table = scene->sky_data + c * (SKY_ROWS + 2) * SKY_COLUMNS;
        const real upper_left = gather(table, upper + left), upper_right = gather(table, upper + right);
        const real lower_left = gather(table, lower + left), lower_right = gather(table, lower + right);
        const real above = upper_left + share_right * (upper_right - upper_left);
        const real below = lower_left + share_right * (lower_right - lower_left);
        collect(path, c, weight_of(path, c) * (above + share_lower * (below - above)), gone);
    }
}
