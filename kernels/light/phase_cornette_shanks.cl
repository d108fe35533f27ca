/*---
title: Rayleigh's shape with a lobe
uses: [light/squared_cosine]
---*/
/* Cornette and Shanks 1992, Physically reasonable analytic expression for the single-scattering phase function; with
   g = 0 it is Rayleigh's. */
static real sample_cosine(const Scene *scene, Rng *rng)
{
    return squared_cosine(scene->optics.g, (SCALAR)1, rng);
}

static real phase(const Scene *scene, const real cosine)
{
    return squared_density(scene->optics.g, (SCALAR)1, cosine);
}
