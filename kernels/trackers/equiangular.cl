/*---
title: Equiangular sampling
estimands: [radiance]
needs: [majorant, light]
escapes: false
citation: Kulla, Fajardo 2012, Importance sampling techniques for path tracing in participating media
---*/
/* The distance is drawn so that equal angles seen from the light are equally likely; the transmittance up to it
   is estimated by ratio tracking, and the path always ends there. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    const Pass pass = pass_light(path, scene);
    path->state.reach = equiangular_distance(pass, uniform(rng), path->ray.length);
    path->state.density = equiangular_density(pass, path->state.reach);
    walk_begin(path, scene);
}

static void step(Path *path, const Scene *scene, Rng *rng) { step_to_reach(path, scene, rng); }
