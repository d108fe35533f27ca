/*---
title: Dust grains
uses: [light/squared_cosine]
---*/
/* Draine 2003, Scattering by interstellar dust grains. I. Optical and ultraviolet, equation 29. */
static real sample_cosine(const Scene *scene, Rng *rng)
{
    return squared_cosine(scene->optics.g, scene->optics.alpha, rng);
}

static real phase(const Scene *scene, const real cosine)
{
    return squared_density(scene->optics.g, scene->optics.alpha, cosine);
}
