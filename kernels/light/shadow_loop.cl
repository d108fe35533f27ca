/* Shadow rays in an inner loop, for trackers that cannot share a step: lanes that have none wait. */
static void light_directly(Path *path, const Scene *scene, const Rng *rng, const mask here)
{
    const mask lit = scatters(path, scene, here);
    Path shadow;
    Rng shadow_rng;
    const real worth = face_light(path, scene, rng, &shadow, &shadow_rng, lit);
    for (int step = 1; step <= SHADOW_STEPS && any_lane(shadow.live); ++step) {
        shadow.steps = (index)step; /* which trackers that march count by */
        shadow_step(&shadow, scene, &shadow_rng);
    }
    path->lookups = shadow.lookups;
    path->crossings = shadow.crossings;
    path->violations = shadow.violations;
    /* a shadow ray without end counts as a path without end */
    path->steps = choose(shadow.live, (index)SHADOW_STEPS, path->steps);
    collect_light(path, scene, &shadow, worth, lit);
}
