/* sigma_t = a + b t along a ray: tau = a t + b t^2 / 2. Its root in the form that does not cancel. */
static real along_start(const Path *path, const Scene *scene)
{
    return scene->medium.bottom + scene->medium.slope * path->ray.origin.z;
}

static real optical_depth(const Path *path, const Scene *scene, const real t)
{
    return t * (along_start(path, scene) + (SCALAR)0.5 * scene->medium.slope * path->ray.direction.z * t);
}

static real distance_to(const Path *path, const Scene *scene, const real depth)
{
    const real a = along_start(path, scene);
    const real b = scene->medium.slope * path->ray.direction.z;
    const real square = a * a + (SCALAR)2 * b * depth;
    return (SCALAR)2 * depth / (a + sqrt(larger(square, (real)0)));
}
