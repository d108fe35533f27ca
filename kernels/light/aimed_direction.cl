/*---
title: Directions that are chosen with a light in mind
state: {aim: real}
---*/
/* Where a path goes on to: with the chance path->state.aim by the angle to the light, of which what a second
   vertex may add is (pi - angle) / sin(angle) to every solid angle; else as the phase function has it. */
static Vector new_direction(Path *path, const Scene *scene, Rng *rng, const mask on)
{
    Vector light;
    way_to_light(path, scene, &light);
    const Vector ahead = heading(path, scene);
    const mask aimed = less(uniform(rng), path->state.aim);
    const real angle = (SCALAR)3.141592653589793 * ((SCALAR)1 - sqrt((SCALAR)1 - uniform(rng)));
    const real by_phase = sample_cosine(scene, rng);
    const real cosine = choose(aimed, cos(angle), by_phase);
    const real sine = choose(aimed, sin(angle), sine_of(by_phase));
    Vector axis = ahead;
    take_vector(&axis, &light, aimed);
    const Vector turned = around(axis, cosine, sine, rng);
    const Vector cross = {turned.y * light.z - turned.z * light.y, turned.z * light.x - turned.x * light.z,
                          turned.x * light.y - turned.y * light.x};
    /* the angle of what was drawn, whichever way: its cosine alone has few digits towards the light */
    const real across = sqrt(dot_of(cross, cross)), along = dot_of(turned, light);
    const real least = (real)ROUNDING, divisor = larger(across, least);
    const real density = ((SCALAR)3.141592653589793 - atan2(across, along)) / divisor * (SCALAR)0.032251534433199495;
    const real given = phase(scene, dot_of(turned, ahead));
    const real drawn = ((SCALAR)1 - path->state.aim) * given + path->state.aim * density;
    path->weight = choose(on, path->weight * given / drawn, path->weight);
    return turned;
}
