/* Light from outside that is the same from all directions. */
static void see_environment(Path *path, const Scene *scene, const mask gone)
{
    for (int c = 0; c < CHANNELS; ++c)
        collect(path, c, weight_of(path, c) * scene->optics.environment[c], gone);
}
