/*---
title: Decomposition tracking
estimands: [transmittance, free_path, radiance, path_length]
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
citation: Kutz, Habel, Li, Novak 2017, Spectral and decomposition tracking for rendering heterogeneous volumes
---*/
/* The control, which must not exceed the extinction, is sampled in closed form and the residual by delta
   tracking; the nearer collision wins. One with the control takes no lookup. */
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
    const real residual = bounded_residual(path, scene, here);
    collide(path, here & less(uniform(rng) * path->majorant, residual));
}
