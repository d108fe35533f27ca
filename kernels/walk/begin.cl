/* A flight of a tracker that keeps nothing of its own begins with its walk. */
static void begin(Path *path, const Scene *scene, Rng *rng) { walk_begin(path, scene); }
