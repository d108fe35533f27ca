/*---
title: Residual ratio tracking
estimands: [transmittance]
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
  Novak, Selle, Jarosz 2014, Residual ratio tracking for estimating attenuation in participating media
---*/
/* The control's transmittance is known; ratio tracking estimates the rest, sigma_t - control, by the weights
   1 - (sigma_t - control) / majorant, which may exceed 1. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    path->target = (real)FAR;
    walk_begin(path, scene);
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask before = path->live;
    mask controlled;
    const mask here = next_residual(path, scene, rng, &controlled);
    const real residual = sigma_t(path, scene, path->t, here) - path->state.control;
    const real null = (path->majorant - residual) / path->majorant;
    path->weight = choose(here, path->weight * null, path->weight);
    const mask left = before & ~path->live;
    if (any_lane(left))
        path->weight = choose(left, path->weight * exp(-path->control_flown), path->weight);
}
