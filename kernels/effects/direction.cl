/* Directions in the world, of unit length, and in the medium, per unit of world length. */
typedef struct {
    real x, y, z;
} Vector;

static Vector in_world(const Scene *scene, const real x, const real y, const real z)
{
    const SCALAR *m = scene->space.to_world;
    const Vector world = {m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z};
    return world;
}

static Vector in_medium(const Scene *scene, const Vector world)
{
    const SCALAR *m = scene->space.to_medium;
    const Vector medium = {m[0] * world.x + m[1] * world.y + m[2] * world.z,
                           m[3] * world.x + m[4] * world.y + m[5] * world.z,
                           m[6] * world.x + m[7] * world.y + m[8] * world.z};
    return medium;
}

static Vector heading(const Path *path, const Scene *scene)
{
    Vector ahead = in_world(scene, path->direction_x, path->direction_y, path->direction_z);
    const real inverse = rsqrt(ahead.x * ahead.x + ahead.y * ahead.y + ahead.z * ahead.z);
    ahead.x *= inverse;
    ahead.y *= inverse;
    ahead.z *= inverse;
    return ahead;
}

static real way_to_face(const real at, const real direction, const SCALAR extent)
{
    const real face = choose(less((real)0, direction), (real)extent, (real)0);
    const mask flat = equal(direction, (real)0);
    const real way = (face - at) / choose(flat, (real)1, direction);
    const real onward = larger(way, (real)0);
    return choose(flat, (real)FAR, onward);
}

/* Lanes `where` start anew where they are, in a direction of the world, on a ray that ends with the medium. */
static void turn(Path *path, const Scene *scene, const Vector world, const mask where)
{
    const Vector ahead = in_medium(scene, world);
    const real x = clamp(path->origin_x + path->t * path->direction_x, (real)0, (real)scene->box.extent_x);
    const real y = clamp(path->origin_y + path->t * path->direction_y, (real)0, (real)scene->box.extent_y);
    const real z = clamp(path->origin_z + path->t * path->direction_z, (real)0, (real)scene->box.extent_z);
    const real to_x = way_to_face(x, ahead.x, scene->box.extent_x);
    const real to_y = way_to_face(y, ahead.y, scene->box.extent_y);
    const real to_z = way_to_face(z, ahead.z, scene->box.extent_z);
    const real nearer = smaller(to_x, to_y);
    const real way = smaller(nearer, to_z);
    path->origin_x = choose(where, x, path->origin_x);
    path->origin_y = choose(where, y, path->origin_y);
    path->origin_z = choose(where, z, path->origin_z);
    path->direction_x = choose(where, ahead.x, path->direction_x);
    path->direction_y = choose(where, ahead.y, path->direction_y);
    path->direction_z = choose(where, ahead.z, path->direction_z);
    path->length = choose(where, way, path->length);
    path->t = choose(where, (real)0, path->t);
    path->depth = choose(where, (real)0, path->depth);
}
