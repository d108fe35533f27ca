/*---
title: The distance at which a closed-form optical depth is reached, by Newton's method
uses: [math/newton]
---*/
static real optical_depth(const Path *path, const Scene *scene, const real t);

static real distance_to(const Path *path, const Scene *scene, const real depth)
{
    const real share = depth / optical_depth(path, scene, path->ray.length);
    Bracket bracket = {(real)0, path->ray.length, path->ray.length * saturate(share), (real)FAR};
    for (int i = 0; i < NEWTON_STEPS; ++i) {
        const real t = bracket.at;
        const Vector at = place_on(&path->ray, t);
        const real sigma = sigma_t_at(scene, at.x, at.y, at.z);
        if (!any_lane(newton(&bracket, optical_depth(path, scene, t) - depth, sigma)))
            break;
    }
    return bracket.at;
}
