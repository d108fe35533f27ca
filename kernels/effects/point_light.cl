/* The light of a point, at every collision that scatters: an estimate of the transmittance between, by a
   tracker of its own (shadow_begin, shadow_step). */
static real transmittance_of_shadow(const Path *shadow, const int channel)
{
    const real kept = choose(shadow->escaped, weight_of(shadow, channel), (real)0);
    return score_of(shadow, channel) + kept;
}

static real way_to_light(const Path *path, const Scene *scene, Vector *to_light)
{
    const real x = path->origin_x + path->t * path->direction_x;
    const real y = path->origin_y + path->t * path->direction_y;
    const real z = path->origin_z + path->t * path->direction_z;
    *to_light = in_world(scene, scene->light.x - x, scene->light.y - y, scene->light.z - z);
    const real square = to_light->x * to_light->x + to_light->y * to_light->y + to_light->z * to_light->z;
    const real distance = sqrt(square);
    to_light->x /= distance;
    to_light->y /= distance;
    to_light->z /= distance;
    return distance;
}

/* Lanes `where` of `shadow` begin their way to the light; returns what it is worth if nothing is in between, but for
   the weights of the path. */
static real face_light(const Path *path, const Scene *scene, Path *shadow, const mask where)
{
    Vector to_light;
    const real distance = way_to_light(path, scene, &to_light);
    const Vector ahead = heading(path, scene);
    const real cosine = ahead.x * to_light.x + ahead.y * to_light.y + ahead.z * to_light.z;
    turn(shadow, scene, to_light, where);
    shadow->length = smaller(shadow->length, distance);
    shadow->target = (real)0;
    shadow->weight = (real)1;
    shadow->live = where;
    shadow->escaped = (mask)0;
    channels_begin(shadow);
    return phase(scene, cosine) / (distance * distance);
}
