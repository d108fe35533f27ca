/* Closed forms along a ray: its optical depth up to t, and where a depth is reached. */
static real optical_depth(const Path *path, const Scene *scene, const real t) { return scene->medium.sigma_t * t; }

static real distance_to(const Path *path, const Scene *scene, const real depth)
{
    return depth / scene->medium.sigma_t;
}
