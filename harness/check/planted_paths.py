"""Defects of paths that scatter and of paths of several channels."""

from __future__ import annotations

from freepath.check.planted import HARD, Defect

SCATTERING = f"{HARD}/scattering"
CHANNELS = f"{HARD}/channels"
ABSORBED = f"{HARD}/p_absorb"
SINGLE = f"{SCATTERING}/single/ratio-g-0.0/delta"
VOXELS = f"{SCATTERING}/voxels/ratio-g-0.6/delta"

PATHS = (
    Defect(
        "a phase function that is not normalised",
        "return (real)(SCALAR)0.0795",
        "return (real)(SCALAR)0.085",
        SINGLE,
    ),
    Defect(
        "a sharp phase function that loses its digits backwards",
        "((SCALAR)1 - sharp) * ((SCALAR)1 - sharp) + (SCALAR)2 * sharp * inside",
        "((SCALAR)1 - g) * ((SCALAR)1 - g) + (SCALAR)2 * g * ((SCALAR)1 - cosine)",
        f"{SCATTERING}/phase/g--0.999",
    ),
    Defect(
        "a cosine that is not drawn as it is evaluated",
        "top / (base * base)",
        "top / base",
        f"{SCATTERING}/phase/g-0.3",
    ),
    Defect(
        "a distance to the light without its square",
        "/ (distance * distance);",
        "/ distance;",
        SINGLE,
    ),
    Defect(
        "an emission collected twice",
        "absorbed * scene->optics.emission[c]",
        "2 * absorbed * scene->optics.emission[c]",
        f"{SCATTERING}/emission/delta",
    ),
    Defect(
        "a scattering albedo left out",
        "= scene->optics.albedo[c] * scene->light.intensity[c];",
        "= scene->light.intensity[c];",
        SINGLE,
    ),
    Defect(
        "albedos of channels swapped",
        "= scene->optics.albedo[c] * scene->light.intensity[c];",
        "= scene->optics.albedo[CHANNELS - 1 - c] * scene->light.intensity[c];",
        f"{CHANNELS}/albedo/history_average",
    ),
    Defect(
        "a shadow ray that goes on behind the light",
        "shadow->ray.length = smaller(shadow->ray.length, distance);",
        "",
        f"{SCATTERING}/light/inside/equiangular",
    ),
    Defect(
        "a lane on a shadow ray that steps on its path too",
        "flight_at_tentative(path, scene, &drawn, here & ~state->shadow, sigma);",
        "flight_at_tentative(path, scene, &drawn, here, sigma);",
        VOXELS,
    ),
    Defect(
        "a path that goes on with the weight of its shadow ray",
        "path->weight = choose(where, path->state.held_weight, path->weight);",
        "",
        VOXELS,
    ),
    Defect(
        "a path that goes on where its shadow ray ended",
        "path->t = choose(where, path->state.held_t, path->t);",
        "",
        f"{SCATTERING}/several/regular/regular",
    ),
    Defect(
        "a ray that its next path does not start on",
        "    restore_ray(path, ended);",
        "",
        f"{SCATTERING}/rod/albedo-0.3-tau-2.0/delta",
    ),
    Defect(
        "an environment that is seen from every collision",
        "see_environment(path, scene, ended & path->escaped);",
        "see_environment(path, scene, ended);",
        f"{SCATTERING}/furnace/homogeneous-tau-1-forward/delta",
    ),
    Defect(
        "a new direction that is not of unit length",
        "axis.x * cosine + along *",
        "axis.x + along *",
        f"{SCATTERING}/length/tau-3.0-g-0.7/delta",
    ),
    Defect(
        "a weight lost in roulette",
        "path->weight / largest",
        "path->weight",
        f"{SCATTERING}/rod/albedo-0.3-tau-2.0/delta",
    ),
    Defect(
        "a survival that a weight is not divided by",
        "path->weight / survival",
        "path->weight",
        f"{ABSORBED}/rod/albedo-0.9-0.3/delta",
    ),
    Defect(
        "paths that are absorbed when they should survive",
        "on & less(uniform(rng), (real)scene->optics.p_absorb)",
        "on & ~less(uniform(rng), (real)scene->optics.p_absorb)",
        f"{ABSORBED}/rod/albedo-0.3-analog/delta",
    ),
    Defect(
        "an albedo that is left out where a path is absorbed by chance",
        "scale_throughput(path, c, (real)scene->optics.albedo[c], on);",
        "",
        f"{ABSORBED}/rod/albedo-0.3-analog/delta",
    ),
    Defect(
        "weights of channels that are divided by another chance than they survive by",
        "(SCALAR)1 - scene->optics.p_absorb;",
        "scene->optics.albedo[0];",
        f"{ABSORBED}/channels/0.3/spectral",
    ),
    Defect(
        "a combined sample that is not weighted",
        "share * end_sigma / (scene->tracker.share * path->state.density)",
        "end_sigma / path->state.density",
        f"{SCATTERING}/light/outside/combined",
    ),
    Defect(
        "a density of equal angles without the light's distance",
        "pass.off / (pass.angle *",
        "(SCALAR)1 / (pass.angle *",
        f"{SCATTERING}/light/outside/equiangular",
    ),
    Defect(
        "a tabulated phase function whose density is left out",
        "equiangular_density(pass, reach) * relative",
        "equiangular_density(pass, reach)",
        f"{SCATTERING}/light/inside/joint-forward",
    ),
    Defect(
        "a table of angles that is searched from its second cell",
        "for (int cell = 0; cell < cells; ++cell) {",
        "for (int cell = 1; cell < cells; ++cell) {",
        f"{SCATTERING}/light/inside/joint-forward",
    ),
    Defect(
        "a direction to the light without the sine of its solid angle",
        "/ divisor *",
        "*",
        f"{SCATTERING}/double/inside/joint-isotropic",
    ),
    Defect(
        "a vertex that is one of two, weighted as if it were the last",
        "((SCALAR)1 - share) * path->state.density + share * by_distance",
        "path->state.density",
        f"{SCATTERING}/double/inside/joint-share",
    ),
    Defect(
        "an inverse distance that is not divided by its integral",
        "(SCALAR)1 / (larger(whole, least) *",
        "(SCALAR)1 / (",
        f"{SCATTERING}/double/outside/joint-isotropic",
    ),
    # channels
    Defect(
        "a spectral weight without the majorant's share",
        "const real scale = (ends + null)",
        "const real scale = (SCALAR)0.98 * (ends + null)",
        f"{CHANNELS}/mean/homogeneous-1.0/history_average",
    ),
    Defect(
        "a probability that the weight is not divided by",
        "(choose(collided, ends, null) * path->majorant)",
        "(null * path->majorant)",
        f"{CHANNELS}/free-path/history_average",
    ),
    Defect(
        "channels swapped",
        "const real extinction = sigma_t * scene->channels.extinction[c];",
        "const real extinction = sigma_t * scene->channels.extinction[CHANNELS - 1 - c];",
        f"{CHANNELS}/free-path/history_average",
    ),
    Defect(
        "a history that is left out",
        "extinction *= fabs(path->state.throughput[c]);",
        "",
        f"{CHANNELS}/bounded/1-1000",
    ),
)
