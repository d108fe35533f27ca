/*---
title: Collision estimator of transmittance
estimands: [transmittance]
needs: [majorant]
bounding: true
state: {absorbed: real}
like: track_length
citation: >-
  Spanier 1966, Two pairs of families of estimators for transport problems; Georgiev, Misso, Hachisuka,
  Nowrouzezahrai, Krivanek, Jarosz 2019, Integral formulations of volumetric transmittance
---*/
/* The track is that of delta tracking. Each tentative collision scores the chance that it is real, of which the sum
   to the first real one has the mean 1 - T. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    path->state.absorbed = (real)0;
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask before = path->live;
    const mask here = next_tentative(path, scene, rng);
    const real sigma = sigma_t_at_tentative(path, scene, here);
    const real chance = sigma / path->majorant;
    path->state.absorbed = choose(here, path->state.absorbed + chance, path->state.absorbed);
    const mask collided = here & less(uniform(rng) * path->majorant, sigma);
    path->weight = choose(collided | (before & ~here), (real)1 - path->state.absorbed, path->weight);
    escape(path, collided);
}
