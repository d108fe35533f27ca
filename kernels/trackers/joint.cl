/*---
title: Joint importance sampling of the last one or two vertices before a light
estimands: [radiance]
needs: [majorant, light]
escapes: false
aims: true
uses: [math/inverse_distance]
parameters:
  cells: {default: 16, minimum: 1, maximum: 64, meaning: of the table of the phase function over the angle}
  share:
    default: 0.5
    minimum: 0
    below: 1
    meaning: chance that a vertex is drawn as the first of two, distance and direction each
citation: >-
  Georgiev, Krivanek, Hachisuka, Nowrouzezahrai, Jarosz 2013, Joint importance sampling of low-order volumetric
  scattering
---*/
/* A vertex that is the last before the light is drawn by the angle that the light sees it under and by its phase
   function. Of two, the first is drawn by the inverse distance to the light, which is what directions and
   distances of the second leave of the product of both (docs/light.md); light/aimed_direction.cl draws its
   direction. A vertex may be either, so its density is that of both. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    const Pass pass = pass_light_by(path, scene, (SCALAR)1e-5);
    const mask another = less(path->state.scatterings + 1, (index)(INTEGER)scene->optics.scatterings);
    const real share = choose(another, (real)scene->tracker.share, (real)0);
    const mask first = less(uniform(rng), share);
    const real u = uniform(rng);
    Receding receding;
    real of_first = (real)0, place = u, relative = (real)1;
    if (any_lane(another)) {
        receding = receding_from(pass.off, pass.nearest, path->ray.length);
        of_first = inverse_distance(receding, u, path->ray.length);
        place = choose(first, place_under_angle(pass, of_first), u);
    }
#ifndef ISOTROPIC
    relative = tabulated_angle(scene, pass, u, first, &place);
#endif
    const real reach = choose(first, of_first, equiangular_distance(pass, place, path->ray.length));
    path->state.density = equiangular_density(pass, reach) * relative;
    if (any_lane(another)) {
        const real by_distance = inverse_distance_density(receding, pass.off, reach - pass.nearest);
        const real both = ((SCALAR)1 - share) * path->state.density + share * by_distance;
        path->state.density = choose(another, both, path->state.density);
    }
    path->state.reach = reach;
    path->state.aim = share;
    walk_begin(path, scene);
}

static void step(Path *path, const Scene *scene, Rng *rng) { step_to_reach(path, scene, rng); }
