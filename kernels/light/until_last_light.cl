/* Lanes `here` have collided; those whose next collision will be lit go on. Where a point is all the light there is, the
   flight behind the last lit collision brings nothing. */
static mask goes_on(const Path *path, const Scene *scene, const mask here)
{
    return here & less(path->state.scatterings + 1, (index)(INTEGER)scene->optics.scatterings);
}
