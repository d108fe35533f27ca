/*---
title: Weighted decomposition tracking
estimands: [transmittance, free_path, radiance, path_length]
needs: [majorant, control]
parameters:
  control:
    choices: [minorant, middle, mean, number]
    default: mean
    host: true
    meaning: >-
      what the control is a share of, cell by cell: the lowest extinction, the middle between the lowest
      and the highest, the mean, or 1
  share: {default: 1, minimum: 0, host: true, meaning: the control over that}
citation: >-
  Kutz, Habel, Li, Novak 2017, Spectral and decomposition tracking for rendering heterogeneous volumes
  (section 3.3)
---*/
/* Any control: where it exceeds the extinction the residual is negative, and so is the weight of a collision
   with it. Real and null collisions are chosen in proportion to |residual| and |null|. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    target_control(path, rng);
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    mask controlled;
    const mask here = next_residual(path, scene, rng, &controlled);
    collide(path, controlled);
    const real residual = sigma_t(path, scene, path->t, here) - path->state.control;
    const real null = path->majorant - residual;
    const real both = fabs(residual) + fabs(null);
    const mask collided = here & less(uniform(rng) * both, fabs(residual));
    const mask negative = choose(collided, less(residual, (real)0), less(null, (real)0));
    const real sign = choose(negative, (real)-1, (real)1);
    const real share = sign * both / path->majorant;
    path->weight = choose(here, path->weight * share, path->weight);
    collide(path, collided);
}
