/*---
title: Track-length estimator of transmittance
estimands: [transmittance]
needs: [majorant]
bounding: true
state: {absorbed: real}
citation: >-
  Spanier 1966, Two pairs of families of estimators for transport problems; Novak, Georgiev, Hanika,
  Jarosz 2018, Monte Carlo methods for volumetric light transport simulation (section 4.2); the derivation
  is in docs/estimators.md
---*/
/* The light that is lost is the expected optical depth of the track to the first collision,
   E[tau(min(X, L))] = 1 - T. Delta tracking ends the track; the depth of each of its segments is estimated
   by one lookup at a random point of it, beside the lookup that ends it. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    path->state.absorbed = (real)0;
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask before = path->live;
    const real t_start = path->t;
    const mask here = next_tentative(path, scene, rng);
    const real segment = path->t - t_start;
    const real on_track = sigma_t(path, scene, t_start + uniform(rng) * segment, before);
    path->state.absorbed = choose(before, path->state.absorbed + on_track * segment, path->state.absorbed);
    const real sigma = sigma_t_at_tentative(path, scene, here);
    const mask collided = here & less(uniform(rng) * path->majorant, sigma);
    path->weight = choose(collided | (before & ~here), (real)1 - path->state.absorbed, path->weight);
    escape(path, collided);
}
