/* Lanes `here` have collided, and all go on: light may be met until they leave. */
static mask goes_on(const Path *path, const Scene *scene, const mask here)
{
    return here;
}
