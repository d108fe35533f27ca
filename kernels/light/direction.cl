/* Directions in the world, of unit length, and in the medium, per unit of world length. */
static Vector mapped(const SCALAR *m, const Vector v)
{
    const Vector to = {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
                       m[6] * v.x + m[7] * v.y + m[8] * v.z};
    return to;
}

static Vector heading(const Path *path, const Scene *scene)
{
    const Vector ahead = mapped(scene->space.to_world, path->ray.direction);
    const real inverse = rsqrt(dot_of(ahead, ahead));
    const Vector unit = {ahead.x * inverse, ahead.y * inverse, ahead.z * inverse};
    return unit;
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
    const Vector at = place_on(&path->ray, path->t);
    Ray next = {at, mapped(scene->space.to_medium, world), (real)0};
    next.origin.x = clamp(at.x, (real)0, (real)scene->box.extent_x);
    next.origin.y = clamp(at.y, (real)0, (real)scene->box.extent_y);
    next.origin.z = clamp(at.z, (real)0, (real)scene->box.extent_z);
    const real to_x = way_to_face(next.origin.x, next.direction.x, scene->box.extent_x);
    const real to_y = way_to_face(next.origin.y, next.direction.y, scene->box.extent_y);
    const real to_z = way_to_face(next.origin.z, next.direction.z, scene->box.extent_z);
    const real nearer = smaller(to_x, to_y);
    next.length = smaller(nearer, to_z);
    take_ray(&path->ray, &next, where);
    start_flight(path, where);
}
