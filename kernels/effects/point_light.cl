/* The light of a point, at every collision that scatters: an estimate of the transmittance between, by a
   tracker of its own (shadow_begin, shadow_step) in an inner loop. */
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

static void light_directly(Path *path, const Scene *scene, const Rng *rng, const mask here)
{
    mask lit = here & less(path->state.scatterings, (index)(INTEGER)scene->optics.scatterings);
    Vector to_light;
    const real distance = way_to_light(path, scene, &to_light);
    const Vector ahead = heading(path, scene);
    const real cosine = ahead.x * to_light.x + ahead.y * to_light.y + ahead.z * to_light.z;
    const real geometry = phase(scene, cosine) / (distance * distance);
    Path shadow = *path;
    turn(&shadow, scene, to_light, lit);
    shadow.length = smaller(shadow.length, distance);
    shadow.target = (real)0;
    shadow.weight = (real)1;
    shadow.live = lit;
    shadow.escaped = (mask)0;
    channels_begin(&shadow);
    Rng shadow_rng = companion(rng);
    shadow_begin(&shadow, scene, &shadow_rng);
    for (int step = 0; step < SHADOW_STEPS && any_lane(shadow.live); ++step)
        shadow_step(&shadow, scene, &shadow_rng);
    path->lookups = shadow.lookups;
    path->crossings = shadow.crossings;
    path->violations = shadow.violations;
    /* a shadow ray without end counts as a path without end */
    path->steps = choose(shadow.live, (index)SHADOW_STEPS, path->steps);
    for (int c = 0; c < CHANNELS; ++c) {
        const real seen = transmittance_of_shadow(&shadow, c);
        const SCALAR power = scene->optics.albedo[c] * scene->light.intensity[c];
        collect(path, c, weight_of(path, c) * geometry * seen * power, lit);
    }
}
