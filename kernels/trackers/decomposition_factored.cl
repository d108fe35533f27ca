/*---
title: Decomposition tracking with the control factored out
estimands: [transmittance]
needs: [majorant, control]
bounding: true
parameters:
  control:
    choices: [minorant, middle, mean, number]
    default: minorant
    host: true
    meaning: >-
      what the control is a share of, cell by cell: the lowest extinction, the middle between the lowest
      and the highest, the mean, or 1
  share: {default: 1, minimum: 0, host: true, meaning: the control over that}
like: decomposition
citation: >-
  Kutz, Habel, Li, Novak 2017, Spectral and decomposition tracking for rendering heterogeneous volumes; Georgiev,
  Misso, Hachisuka, Nowrouzezahrai, Krivanek, Jarosz 2019, Integral formulations of volumetric transmittance
---*/
/* T is that of the control, which is known, times that of the residual, which delta tracking plays for. */
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
    const mask left = before & ~path->live;
    if (any_lane(left))
        path->weight = choose(left, path->weight * exp(-path->control_flown), path->weight);
    const real residual = bounded_residual(path, scene, here);
    collide(path, here & less(uniform(rng) * path->majorant, residual));
}
