/*---
title: The bare lookup
estimands: [mean_extinction]
needs: []
parameters:
  lookups: {default: 64, minimum: 1, maximum: 100000, meaning: lookups a sample}
citation: no paper; a yardstick of what the medium alone costs
---*/
/* Evaluates the medium at uniformly random points of its box and does nothing else: the mean extinction. */
static void begin(Path *path, const Scene *scene, Rng *rng) { path->weight = (real)0; }

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const real x = uniform(rng) * scene->box.extent_x;
    const real y = uniform(rng) * scene->box.extent_y;
    const real z = uniform(rng) * scene->box.extent_z;
    count(path->lookups, path->live);
    path->weight = choose(path->live, path->weight + sigma_t_at(scene, x, y, z), path->weight);
    const mask last = path->live & ~less(to_real(path->steps), (real)scene->tracker.lookups);
    path->weight = choose(last, path->weight / scene->tracker.lookups, path->weight);
    escape(path, last);
}
