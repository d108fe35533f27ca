/*---
title: Next-flight ratio tracking
estimands: [transmittance]
needs: [majorant]
shares_lookup: true
state:
  throughput: real
  total: real
citation: >-
  Cramer 1978, Application of the fictitious scattering model for deep-penetration Monte Carlo
  calculations; Novak, Georgiev, Hanika, Jarosz 2018, section 4.2
---*/
/* At the start and after every null collision the chance of flying out without another tentative collision,
   exp(-majorant depth ahead), is scored; the flight itself only finds the collisions. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    path->weight = (real)0;
    path->state.throughput = (real)1;
    path->state.total = majorant_depth(path, scene);
    deposit(path, exp(-path->state.total), path->length, (mask)-1, (mask)-1);
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask here = next_tentative(path, scene, rng);
    const real sigma_n = path->majorant - sigma_t_at_tentative(path, scene, here);
    const real null = sigma_n / path->majorant;
    const real throughput = path->state.throughput * null;
    path->state.throughput = choose(here, throughput, path->state.throughput);
    const real ahead = majorant_depth_ahead(path, scene, path->state.total, here);
    deposit(path, throughput * exp(-ahead), path->length, (mask)-1, here);
}
