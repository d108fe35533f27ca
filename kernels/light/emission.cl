/* The medium emits: where a path is absorbed it collects the source's radiance. */
static void emit(Path *path, const Scene *scene, const mask here)
{
    for (int c = 0; c < CHANNELS; ++c) {
        const SCALAR absorbed = (SCALAR)1 - scene->optics.albedo[c];
        collect(path, c, weight_of(path, c) * (absorbed * scene->optics.emission[c]), here);
    }
}
