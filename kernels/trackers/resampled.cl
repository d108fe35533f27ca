/*---
title: Resampled flight with a chosen chance to scatter
estimands: [transmittance, free_path, radiance, path_length]
needs: [majorant]
parameters:
  scatter: {default: 0.5, minimum: 0, below: 1, meaning: chance of a collision of flights that could have one}
state:
  candidates: real
  kept: real
  negative: mask
like: delta
citation: >-
  Xu, Herholz, Manzi, Papas, Gross 2024, Volume scattering probability guiding, ACM Transactions on Graphics 43 (6)
---*/
/* The flight goes to the end of the ray as that of ratio tracking does. Each tentative collision is a candidate with
   the weight of its real branch, of which a weighted reservoir keeps one. At the end the flight collides there by the
   chosen chance, with all candidates' weight, or leaves with what the null branches left. Without a candidate that
   weighs anything it leaves for sure. Signs are kept apart: where the majorant does not bound, weights have both. */
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    path->state.candidates = path->state.kept = (real)0;
    path->state.negative = (mask)0;
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    State *state = &path->state;
    const mask before = path->live;
    const mask here = next_tentative(path, scene, rng);
    const real sigma = sigma_t_at_tentative(path, scene, here);
    const real candidate = path->weight * (sigma / path->majorant);
    const real null = (path->majorant - sigma) / path->majorant;
    state->candidates = choose(here, state->candidates + fabs(candidate), state->candidates);
    const real u = uniform(rng);
    const mask kept = here & less(u * state->candidates, fabs(candidate));
    state->kept = choose(kept, path->t, state->kept);
    state->negative = choose(kept, less(candidate, (real)0), state->negative);
    path->weight = choose(here, path->weight * null, path->weight);
    const SCALAR scatter = scene->tracker.scatter;
    const mask chosen = before & ~path->live & less((real)0, state->candidates);
    const mask collided = chosen & less(u, (real)scatter);
    const real all = choose(state->negative, -state->candidates, state->candidates);
    const real share = choose(collided, all / (real)scatter, path->weight / ((SCALAR)1 - scatter));
    path->weight = choose(chosen, share, path->weight);
    path->t = choose(collided, state->kept, path->t);
    path->escaped &= ~collided;
}
