/* With m the extinction where the ray starts and k its direction's height over the scale height:
   tau = m (1 - exp(-k t)) / k, so t = -log(1 - k tau / m) / k. Both in the form that a horizontal ray,
   k = 0, does not divide by 0. */
static real start_sigma_t(const Path *path, const Scene *scene)
{
    return sigma_t_at(scene, path->ray.origin.x, path->ray.origin.y, path->ray.origin.z);
}

static real optical_depth(const Path *path, const Scene *scene, const real t)
{
    const real x = path->ray.direction.z * scene->medium.inverse_height * t;
    const mask flat = equal(x, (real)0);
    const real ratio = choose(flat, (real)1, -expm1(-x) / choose(flat, (real)1, x));
    return start_sigma_t(path, scene) * t * ratio;
}

static real distance_to(const Path *path, const Scene *scene, const real depth)
{
    const real straight = depth / start_sigma_t(path, scene);
    const real y = path->ray.direction.z * scene->medium.inverse_height * straight;
    const mask flat = equal(y, (real)0);
    /* Rounding may put y at 1 when the depth is that of the whole atmosphere. */
    const real below_1 = smaller(y, (real)((SCALAR)1 - (SCALAR)ROUNDING));
    return straight * choose(flat, (real)1, -log1p(-below_1) / choose(flat, (real)1, below_1));
}
