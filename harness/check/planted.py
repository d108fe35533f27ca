"""Defects of weights, walks and media; each a slip of a hand, with the check that must see it."""

from __future__ import annotations

from typing import NamedTuple


class Defect(NamedTuple):
    """A slip of a hand: what it is, a piece of the source and what is in its place, who sees it."""

    what: str
    old: str
    new: str
    check: str


ID = "identity"
HARD = "hard"
RATIO = f"{ID}/ratio/transmittance/trilinear/grid"
DELTA = f"{ID}/delta/transmittance/trilinear/grid"
PARTS = f"{HARD}/random-numbers"

KERNELS = (
    # weights and probabilities
    Defect(
        "a null probability wrong by 2 %",
        "real null = sigma_n / path->majorant",
        "real null = 0.98f * sigma_n / path->majorant",
        RATIO,
    ),
    Defect(
        "a weight that is not divided by the majorant",
        "real null = sigma_n / path->majorant",
        "real null = sigma_n",
        RATIO,
    ),
    Defect(
        "a weight that a path leaves to the next",
        "into->weight = choose(where, from->weight, into->weight);",
        "",
        f"{ID}/ratio/transmittance/homogeneous/global",
    ),
    Defect(
        "roulette instead of a weight",
        "path->weight * null,",
        "choose(less(uniform(rng), null), path->weight, (real)0),",
        "moments/ratio/trilinear/grid",
    ),
    Defect(
        "collisions too often by 5 %",
        "uniform(rng) * path->majorant,",
        "uniform(rng) * 0.95f * path->majorant,",
        DELTA,
    ),
    Defect(
        "a null coefficient that is clamped at 0",
        "const real null = sigma_n / path->majorant;",
        "const real null = saturate(sigma_n / path->majorant);",
        f"{HARD}/non-bounding/0.5/ratio",
    ),
    Defect(
        "a sign that is lost where the null coefficient is negative",
        "choose(collided | less((real)0, sigma_n), (real)1, (real)-1)",
        "(real)1",
        f"{HARD}/non-bounding/0.5/weighted_delta",
    ),
    Defect(
        "a sign that is lost where the residual is negative",
        "choose(negative, (real)-1, (real)1)",
        "(real)1",
        f"{ID}/weighted_decomposition/free_path/trilinear/octree",
    ),
    Defect(
        "an approximate reciprocal of the majorant",
        "const real null = sigma_n / path->majorant;",
        "const real reciprocal = path->mean_free_path * 0.9999999f;\n"
        "    const real null = (SCALAR)1 - (path->majorant - sigma_n) * reciprocal;",
        f"{HARD}/residual/null-of-zero/ratio",
    ),
    Defect(
        "the control's transmittance left out",
        "path->weight * exp(-path->control_flown), path->weight);",
        "path->weight, path->weight);",
        f"{ID}/residual_ratio/transmittance/homogeneous/global",
    ),
    Defect(
        "collisions with the control that count as escapes",
        "    collide(path, controlled);\n    const real residual = bounded",
        "    escape(path, controlled);\n    const real residual = bounded",
        f"{ID}/decomposition/transmittance/homogeneous/global",
    ),
    Defect(
        "the real branch of a split that is not scored",
        "path->weight * real_share, path->t, (mask)0, here);",
        "path->weight * real_share, path->t, (mask)0, here & (mask)0);",
        f"{ID}/split/free_path/trilinear/octree",
    ),
    Defect(
        "a next flight from the start of the ray each time",
        "survival * exp(-ahead)",
        "survival * exp(-path->state.total)",
        f"{ID}/next_flight_ratio/transmittance/trilinear/grid",
    ),
    Defect(
        "a depth ahead with the roundings of all that was flown",
        "return choose(walked, depth, ahead);",
        "return ahead;",
        f"{HARD}/loose/1e6/next_flight_delta",
    ),
    Defect(
        "a term of the series that is lost in part",
        "splat(path, mass * state->term, path->ray.length",
        "splat(path, mass * state->term * 0.95f, path->ray.length",
        f"{ID}/p_series_cmf/transmittance/trilinear/grid",
    ),
    Defect(
        "a telescoping term that is not divided by all of its chance",
        "((SCALAR)1 - scene->tracker.ratio) * exp(",
        "exp(",
        f"{ID}/telescoping_march/transmittance/trilinear/global",
    ),
    Defect(
        "a comb whose last tooth is left out",
        "const real length = path->ray.length / state->teeth;",
        "const real length = path->ray.length / (state->teeth + (SCALAR)1);",
        f"{ID}/unbiased_march/transmittance/homogeneous/global",
    ),
    Defect(
        "a segment that is looked up at its end, not at a random point",
        "t_start + uniform(rng) * segment",
        "t_start + segment",
        f"{ID}/track_length/transmittance/trilinear/grid",
    ),
    # walks and media
    Defect(
        "a distance that starts anew in each cell",
        "draw = choose(crossing, larger(left, (real)0), draw);",
        "",
        DELTA,
    ),
    Defect(
        "the majorant of the cell beside",
        "(at.y + 1) * row + (at.x + 1);",
        "at.y * row + (at.x + 1);",
        f"{ID}/delta/free_path/gaussian/grid",
    ),
    Defect(
        "a walk that leaves one cell too late",
        "(SCALAR)1 - where,",
        "(SCALAR)2 - where,",
        f"{ID}/delta/free_path/gaussian/grid",
    ),
    Defect(
        "a walk that steps along the wrong axis",
        "choose(less(path->ray.direction.y, (real)0), (index)-row, (index)row)",
        "choose(less(path->ray.direction.y, (real)0), (index)-1, (index)1)",
        DELTA,
    ),
    Defect(
        "an interpolation along the wrong axis",
        "mix_lanes(mix_lanes(low_0, low_1, fy), mix_lanes(high_0, high_1, fy), fz)",
        "mix_lanes(mix_lanes(low_0, low_1, fz), mix_lanes(high_0, high_1, fz), fy)",
        DELTA,
    ),
    Defect(
        "denormal halves that are flushed to 0",
        "#define half_at(p, i) vload_half((size_t)(i), p)",
        "#define half_at(p, i) (vload_half((size_t)(i), p) < 6.1e-5f ? 0.0f : "
        "vload_half((size_t)(i), p))",
        f"{HARD}/contrast/half-denormal/ratio",
    ),
    Defect(
        "halves of which every other one is read twice",
        "#define half_at(p, i) vload_half((size_t)(i), p)",
        "#define half_at(p, i) vload_half((size_t)(i) & ~(size_t)1, p)",
        f"{HARD}/contrast/half-rounded/delta",
    ),
    Defect(
        "halves whose exponent is one too small",
        "#define half_at(p, i) vload_half((size_t)(i), p)",
        "#define half_at(p, i) (0.5f * vload_half((size_t)(i), p))",
        f"{HARD}/contrast/half-values/16-lanes",
    ),
    Defect(
        "a cubic integrated with a wrong coefficient",
        "(SCALAR)0.5 * cell.c1",
        "(SCALAR)0.45 * cell.c1",
        f"{ID}/regular/transmittance/trilinear/global",
    ),
    Defect(
        "the last cell of a ray left out",
        "path->depth = choose(path->live, depth,",
        "path->depth = choose(path->live & less(t_exit, path->ray.length), depth,",
        f"{ID}/regular/transmittance/layered/global",
    ),
    Defect(
        "a root that is not waited for",
        "#define NEWTON_STEPS 64",
        "#define NEWTON_STEPS 4",
        "inversion-double/analytic/free_path/gaussian/global",
    ),
    Defect(
        "a flight that escapes where it last was",
        "path->t = choose(where, path->ray.length, path->t);",
        "",
        f"{ID}/delta/free_path/homogeneous/grid",
    ),
)
