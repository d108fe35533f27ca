/*---
title: The distance at which a closed-form optical depth is reached, by Newton's method
uses: [math/newton]
---*/
static real optical_depth(const Path *path, const Scene *scene, const real t);

static real distance_to(const Path *path, const Scene *scene, const real depth)
{
    const real share = depth / optical_depth(path, scene, path->length);
    Bracket bracket = {(real)0, path->length, path->length * saturate(share), (real)FAR};
    for (int i = 0; i < NEWTON_STEPS; ++i) {
        const real t = bracket.at;
        const real sigma = sigma_t_at(scene, path->origin_x + t * path->direction_x,
                                      path->origin_y + t * path->direction_y, path->origin_z + t * path->direction_z);
        if (!any_lane(newton(&bracket, optical_depth(path, scene, t) - depth, sigma)))
            break;
    }
    return bracket.at;
}
