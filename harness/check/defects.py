"""The test of the tests: defects to plant in the kernels, each with the check that must catch it.

`python -m freepath.check.defects [DEVICE]` plants each and prints the table of docs/defects.md.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from freepath import catalog
from freepath.check import registry
from freepath.check.model import LEVEL, Check
from freepath.check.rig import Change, Rig
from freepath.check.verdict import Failure
from freepath.device import open_devices
from freepath.errors import FAILED


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

DEFECTS = (
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
        "path->weight = choose(where, new_path.weight, path->weight);",
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
        "path->weight * exp(-path->depth), path->weight);",
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
        "throughput * exp(path->depth - path->state.total)",
        "throughput * exp(-path->state.total)",
        f"{ID}/next_flight_ratio/transmittance/trilinear/grid",
    ),
    Defect(
        "a Poisson probability of the order before",
        "const real ratio = path->depth / order;",
        "const real ratio = path->depth / (order + (SCALAR)1);",
        f"{ID}/p_series_cmf/transmittance/trilinear/global",
    ),
    Defect(
        "a telescoping term that is not divided by all of its chance",
        "((SCALAR)1 - scene->tracker.ratio) * exp(",
        "exp(",
        f"{ID}/telescoping_march/transmittance/trilinear/global",
    ),
    Defect(
        "a power series without its factorial",
        "factorial *= k;",
        "",
        f"{ID}/unbiased_march/transmittance/trilinear/grid",
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
        "(j + 1) * row + (i + 1);",
        "j * row + (i + 1);",
        DELTA,
    ),
    Defect(
        "a walk that leaves one cell too late", "(SCALAR)1 - where,", "(SCALAR)2 - where,", DELTA
    ),
    Defect(
        "a walk that steps along the wrong axis",
        "choose(less(path->direction_y, (real)0), (index)-row, (index)row)",
        "choose(less(path->direction_y, (real)0), (index)-1, (index)1)",
        DELTA,
    ),
    Defect(
        "an interpolation along the wrong axis",
        "mix_lanes(mix_lanes(low_0, low_1, fy), mix_lanes(high_0, high_1, fy), fz)",
        "mix_lanes(mix_lanes(low_0, low_1, fz), mix_lanes(high_0, high_1, fz), fy)",
        DELTA,
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
        "path->depth = choose(path->live & less(t_exit, path->length), depth,",
        f"{ID}/regular/transmittance/layered/global",
    ),
    Defect(
        "a layer walked into beyond the last",
        "choose(flat | outermost | less(",
        "choose(flat | less(",
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
        "path->t = choose(where, path->length, path->t);",
        "",
        f"{ID}/delta/free_path/homogeneous/grid",
    ),
    # random numbers
    Defect(
        "log(u + eps)",
        "-logarithm((SCALAR)1 - uniform(rng))",
        "-logarithm((SCALAR)1 - uniform(rng) + (SCALAR)1e-6)",
        f"{PARTS}/extremes/1-lanes",
    ),
    Defect(
        "u = 1 possible",
        "to_real(next_bits(rng) >> 8) * (SCALAR)5.9604644775390625e-8",
        "to_real(next_bits(rng)) * (SCALAR)2.3283064365386963e-10",
        f"{PARTS}/extremes/16-lanes",
    ),
    Defect(
        "free paths of a bent distribution",
        "return -logarithm((SCALAR)1 - uniform(rng));",
        "const real u = uniform(rng);\n"
        "return -logarithm((SCALAR)1 - u - 0.3f * u * (1.0f - u) * (1.0f - 2.0f * u));",
        "distribution/analytic/free_path/homogeneous/global",
    ),
    Defect(
        "one stream for all samples of a ray",
        "{ray, low, high, (bits)0}",
        "{ray, (bits)0, high, (bits)0}",
        f"{PARTS}/disjoint/16-lanes",
    ),
    Defect(
        "one stream for all rays",
        "{ray, low, high, (bits)0}",
        "{(bits)0, low, high, (bits)0}",
        f"{PARTS}/disjoint/16-lanes",
    ),
    Defect(
        "sample numbers that wrap at 2^32",
        "(bits)(uint)(first >> 32) + carry(low, offset)",
        "(bits)(uint)(first >> 32)",
        f"{PARTS}/streams/16-lanes",
    ),
    Defect("nine rounds of Philox", "round < 10", "round < 9", f"{PARTS}/known-answers/1-lanes"),
    Defect(
        "another rotation in xoshiro",
        "rotate_left(rng->s3, 11)",
        "rotate_left(rng->s3, 12)",
        f"{PARTS}/published/16-lanes",
    ),
    Defect(
        "reused random numbers: the control draws what the residual draws",
        "Rng control_rng = companion(rng);",
        "Rng control_rng = *rng;",
        f"{ID}/decomposition/transmittance/trilinear/grid",
    ),
    Defect(
        "samples numbered within their block",
        "block * (index)(INTEGER)samples + tally->done;",
        "tally->done;",
        f"{HARD}/long-runs/blocks",
    ),
    # counting
    Defect(
        "a lookup counted twice",
        "count(path->lookups, here);",
        "path->lookups -= 2 * here;",
        "moments/delta/trilinear/grid",
    ),
    Defect(
        "a lookup that is not counted",
        "count(path->lookups, here);",
        "",
        "moments/delta/trilinear/grid",
    ),
    Defect(
        "violations that are not counted",
        "count(path->violations, here & less(path->majorant * (SCALAR)1.000001, sigma));",
        "",
        f"{HARD}/non-bounding/0.5/delta",
    ),
    Defect(
        "paths cut off without being counted",
        "tally->truncated -= truncated;",
        "",
        f"{HARD}/loose/step-cap/ratio",
    ),
    Defect(
        "a step cap that is not where it should be",
        "~less(path->steps, (index)(INTEGER)step_cap)",
        "~less(path->steps, (index)(INTEGER)step_cap * 2)",
        f"{HARD}/loose/step-cap/ratio",
    ),
    Defect(
        "a mean that stands still in float",
        "const real excess = mean - tally->mean - rise;",
        "const real excess = (real)0;",
        f"{HARD}/accumulation/still-mean",
    ),
    Defect(
        "squares of deviations from the old mean",
        "deviation * (x - mean + excess)",
        "deviation * deviation",
        f"{HARD}/accumulation/sixteen-million",
    ),
)


def caught(rig: Rig, defect: Defect, check: Check) -> str:
    """What the check says of the changed kernel; '' where it finds nothing wrong.

    Raises LookupError where the check builds no source with a place for the defect.
    """
    change = Change(defect.old, defect.new)
    try:
        check.run(rig.with_change(change), LEVEL)
    except Failure as failure:
        return str(failure)
    if not change.planted:
        raise LookupError(f"{check.name} builds nothing with a place for '{defect.what}'")
    return ""


def main(arguments: Sequence[str]) -> int:
    """Plant each defect on a device and print who caught it; 8 where one was missed."""
    known = catalog.load()
    checks = {check.name: check for check in registry.checks(known)}
    print("| planted defect | caught by | which said |\n| --- | --- | --- |")
    missed = 0
    with tempfile.TemporaryDirectory(prefix="freepath-defects-") as folder:
        rig = Rig(open_devices(list(arguments))[0], known, Path(folder))
        for defect in DEFECTS:
            said = caught(rig, defect, checks[defect.check])
            missed += not said
            text = said.splitlines()[0].replace("|", "\\|") if said else "**nothing: missed**"
            print(f"| {defect.what} | `{defect.check}` | {text} |", flush=True)
    return FAILED if missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
