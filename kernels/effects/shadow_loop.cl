/* Shadow rays in an inner loop, for trackers that cannot share a step: lanes that have none wait. */
static void light_directly(Path *path, const Scene *scene, const Rng *rng, const mask here)
{
    const mask lit = here & less(path->state.scatterings, (index)(INTEGER)scene->optics.scatterings);
    Path shadow = *path;
    const real geometry = face_light(path, scene, &shadow, lit);
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
