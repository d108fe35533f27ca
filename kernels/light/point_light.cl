/* The light of a point, at every collision that scatters: an estimate of the transmittance between, by a
   tracker of its own (shadow_begin, and shadow_step or shadow_at_tentative). */
#define SHADOW_STEPS (1 << 20)

static real way_to_light(const Path *path, const Scene *scene, Vector *to_light)
{
    const Vector at = place_on(&path->ray, path->t);
    const Vector way = {scene->light.x - at.x, scene->light.y - at.y, scene->light.z - at.z};
    *to_light = mapped(scene->space.to_world, way);
    const real distance = sqrt(dot_of(*to_light, *to_light));
    to_light->x /= distance;
    to_light->y /= distance;
    to_light->z /= distance;
    return distance;
}

/* Lanes `where` begin their way to the light, on a copy of their path and with random numbers of its own. Returns
   what it is worth if nothing is in between, but for the weights of the path. */
static real face_light(const Path *path, const Scene *scene, const Rng *rng, Path *shadow, Rng *shadow_rng,
                       const mask where)
{
    Vector to_light;
    *shadow = *path;
    const real distance = way_to_light(path, scene, &to_light);
    const real cosine = dot_of(heading(path, scene), to_light);
    turn(shadow, scene, to_light, where);
    shadow->ray.length = smaller(shadow->ray.length, distance);
    shadow->weight = (real)1;
    shadow->live = where;
    shadow->escaped = (mask)0;
    channels_begin(shadow);
    *shadow_rng = companion(rng);
    shadow_begin(shadow, scene, shadow_rng);
    return phase(scene, cosine) / (distance * distance);
}

/* Lanes `where` collect what a shadow ray of that worth lets through to their collision. */
static void collect_light(Path *path, const Scene *scene, const Path *shadow, const real worth, const mask where)
{
    for (int c = 0; c < CHANNELS; ++c) {
        const real kept = choose(shadow->escaped, weight_of(shadow, c), (real)0);
        const real seen = score_of(shadow, c) + kept;
        const SCALAR power = scene->optics.albedo[c] * scene->light.intensity[c];
        collect(path, c, weight_of(path, c) * worth * seen * power, where);
    }
}
