/*---
title: Delta tracking and equiangular sampling, combined
estimands: [radiance]
needs: [majorant, light]
bounding: true
parameters:
  share: {default: 0.5, above: 0, below: 1, meaning: chance of an equiangular distance}
state: {angular: mask, rate: real}
citation: >-
  Veach, Guibas 1995, Optimally combining sampling techniques for Monte Carlo rendering; Kulla, Fajardo 2012,
  Importance sampling techniques for path tracing in participating media
---*/
/* One of the two is drawn, and weighted by the balance heuristic. The density of delta tracking is known only up
   to the transmittance, so the heuristic takes that of a homogeneous medium of a mean extinction: any weights
   that sum to 1 at every distance are right. Both lanes share a step's lookup. */
static real mis_weight(const Path *path, const Scene *scene, const real t, const real density)
{
    const real angular = scene->tracker.share * density;
    const real other = ((SCALAR)1 - scene->tracker.share) * path->state.rate * exp(-path->state.rate * t);
    /* not a share of the sum: the density is infinite where a path has no length */
    return (SCALAR)1 / ((SCALAR)1 + other / angular);
}

static void begin(Path *path, const Scene *scene, Rng *rng)
{
    const Pass pass = pass_light(path, scene);
    real sum = (real)0;
    for (int i = 0; i < 4; ++i)
        sum += sigma_t(path, scene, ((SCALAR)i + (SCALAR)0.5) / 4 * path->ray.length, (mask)-1);
    path->state.rate = sum / (SCALAR)4;
    path->state.angular = less(uniform(rng), (real)scene->tracker.share);
    const real reach = equiangular_distance(pass, uniform(rng), path->ray.length);
    path->state.reach = choose(path->state.angular, reach, path->ray.length);
    path->state.density = equiangular_density(pass, reach);
    walk_begin(path, scene);
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask before = path->live, angular = path->state.angular;
    const mask here = next_tentative_within(path, scene, rng, path->state.reach);
    const real sigma = sigma_t_at_tentative(path, scene, here);
    const mask collided = here & ~angular & less(uniform(rng) * path->majorant, sigma);
    const real null = (path->majorant - sigma) / path->majorant;
    path->weight = choose(here & angular, path->weight * null, path->weight);
    collide(path, collided);
    const mask ended = before & ~path->live, arrived = ended & angular;
    if (!any_lane(ended))
        return;
    const Pass pass = pass_light(path, scene);
    const real end_sigma = sigma_t(path, scene, path->t, arrived);
    const real density = equiangular_density(pass, path->t);
    const real share = mis_weight(path, scene, path->t, density);
    const real by_angle = share * end_sigma / (scene->tracker.share * path->state.density);
    const real escaped = choose(path->escaped, (real)1, (SCALAR)1 - share);
    const real factor = choose(arrived, by_angle, escaped / ((SCALAR)1 - scene->tracker.share));
    path->weight = choose(ended, path->weight * factor, path->weight);
    path->escaped &= ~arrived;
}
