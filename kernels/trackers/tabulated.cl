/*---
title: Tabulated sampling
estimands: [radiance]
needs: [majorant, light]
escapes: false
parameters:
  table:
    choices: [transmittance, product]
    default: product
    meaning: what is tabulated, extinction x transmittance or that over the squared distance of the light
  bins: {default: 16, minimum: 2, maximum: 64, meaning: lookups along a ray}
  even: {default: 0.1, above: 0, maximum: 1, meaning: share of the density that is the same everywhere}
citation: >-
  Novak, Nowrouzezahrai, Dachsbacher, Jarosz 2012, Virtual ray lights for rendering scenes with participating
  media (of tabulated distances)
---*/
/* The extinction is looked up in the middle of equal bins, which gives a density that is constant in each. It is
   walked through twice, once for its sum and once up to the bin that is drawn. */
static real bin_value(Path *path, const Scene *scene, const Pass pass, const int bin, const real width, real *depth,
                      const mask counted)
{
    const real t = ((SCALAR)bin + (SCALAR)0.5) * width;
    const real sigma = sigma_t(path, scene, t, counted);
    const real value = sigma * exp(-(*depth + (SCALAR)0.5 * sigma * width));
    *depth += sigma * width;
#if TABLE == TABLE_PRODUCT
    const real along = t - pass.nearest;
    return value / (pass.off * pass.off + along * along);
#else
    return value;
#endif
}

static void begin(Path *path, const Scene *scene, Rng *rng)
{
    const int bins = (int)scene->tracker.bins;
    const Pass pass = pass_light(path, scene);
    const real width = path->ray.length / scene->tracker.bins;
    real sum = (real)0, depth = (real)0;
    for (int bin = 0; bin < bins; ++bin)
        sum += bin_value(path, scene, pass, bin, width, &depth, (mask)-1);
    /* in empty space every bin is alike */
    const real even = choose(less((real)0, sum), scene->tracker.even * sum / bins, (real)1);
    const real total = sum + even * bins;
    real left = uniform(rng) * total, found = (real)0, share = (real)0;
    mask looking = (mask)-1;
    depth = (real)0;
    for (int bin = 0; bin < bins; ++bin) {
        const real value = even + bin_value(path, scene, pass, bin, width, &depth, (mask)0);
        const mask here = looking & (bin == bins - 1 ? (mask)-1 : less(left, value));
        found = choose(here, (SCALAR)bin + left / value, found);
        share = choose(here, value / total, share);
        left -= choose(looking, value, (real)0);
        looking &= ~here;
    }
    const real reach = found * width;
    path->state.reach = clamp(reach, (real)0, path->ray.length);
    path->state.density = share / width;
    walk_begin(path, scene);
}

static void step(Path *path, const Scene *scene, Rng *rng) { step_to_reach(path, scene, rng); }
