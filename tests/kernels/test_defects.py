"""Each check is shown to fail: defects are planted in the kernels, one at a time.

A defect is a small change of the composed source, as a slip of a hand would make it. Its check
passes on the kernel as it is and fails on the changed one; if the changed text is there no more,
the test errs, so that it cannot go stale unseen.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from freepath.check import cases
from freepath.check.identities import (
    check_clean,
    check_count,
    check_mean,
    check_order,
    check_same_samples,
    check_variance,
)
from freepath.check.rig import Change
from freepath.check.truth import MajorantAlongRays

ALPHA = 1e-4


def whole(rig, **axes):
    """All that is checked of any tracker."""
    cases.check_case(rig, axes, ALPHA)


def distribution(rig, **axes):
    flight = rig.flight(**axes)
    cases.check_distribution(flight, flight.record(256), ALPHA)


def cleanness(rig, **axes):
    check_clean(rig.flight(**axes).run(2), bounded=True)


def variance(rig, **axes):
    flight = rig.flight(**axes)
    depth = flight.medium.optical_depth(flight.segments)
    majorant = MajorantAlongRays(flight.case.majorant, flight.medium, 1.0, flight.segments)
    expected = np.exp(-2.0 * depth) * np.expm1(majorant.square_over_majorant())
    check_variance(flight.record(2048).score, expected, ALPHA)


def cost(rig, **axes):
    flight = rig.flight(**axes)
    majorant = MajorantAlongRays(flight.case.majorant, flight.medium, 1.0, flight.segments)
    check_count(flight.record(512).lookups, majorant.collisions_until_real(), ALPHA)


def order(rig, **axes):
    steps = np.array([0.1, 0.05, 0.025])
    bias = []
    for step in steps:
        tracker = {"march": {"step": float(step), "placement": "midpoint"}}
        flight = rig.flight(tracker=tracker, arithmetic="double", **axes)
        bias.append(np.sqrt(np.mean((flight.run(2).moments.mean - flight.reference()) ** 2)))
    check_order(steps, np.array(bias), 2, tolerance=0.1)


def thin_mean(rig, **axes):
    flight = rig.flight(**axes, tightness=1e4)
    check_mean(flight.run(2048).moments, flight.reference(), ALPHA)


def each_path(rig, **axes):
    axes = axes | {"estimand": "free_path", "arithmetic": "double", "lanes": 4}
    flight = rig.flight(**axes)
    rays = {"orthographic": {"resolution": 16}}
    deep = {"homogeneous": {"sigma_t": 1, "size": 1000}}
    depths = rig.flight(**axes | {"tracker": "analytic", "medium": deep}, rays=rays).record(256).t
    cases.check_each_path(flight, flight.record(256), depths)


def same_samples(rig, **axes):
    """In two blocks as in one."""
    flight = rig.flight(**axes)
    one, other = flight.record(256), flight.record(128, blocks=2)
    scores = one.score, other.score
    check_same_samples(*scores, (one.lookups, other.lookups), flight.rounding)


class Defect(NamedTuple):
    check: Callable
    message: str
    change: Change
    axes: dict[str, Any]


RATIO = {"tracker": "ratio", "medium": "gaussian", "lanes": 1}
DELTA = {"tracker": "delta", "medium": "cosine", "majorant": "grid", "lanes": 1}
ANALYTIC = {"tracker": "analytic", "medium": "exponential", "estimand": "free_path", "lanes": 1}
REGULAR = {"tracker": "regular", "medium": "trilinear", "lanes": 1}

DEFECTS = {
    "a null probability wrong by 2 %": Defect(
        whole,
        "mean",
        Change(
            "real null = sigma_n / path->majorant", "real null = 0.98f * sigma_n / path->majorant"
        ),
        RATIO,
    ),
    "a weight that is not divided by the majorant": Defect(
        whole,
        "mean",
        Change("real null = sigma_n / path->majorant", "real null = sigma_n"),
        RATIO,
    ),
    "a weight that a path leaves to the next": Defect(
        whole,
        "mean|error",
        Change("path->weight = choose(where, new_path.weight, path->weight);", ""),
        RATIO,
    ),
    "roulette instead of a weight": Defect(
        variance,
        "variance",
        Change("path->weight * null,", "choose(less(uniform(rng), null), path->weight, (real)0),"),
        RATIO,
    ),
    "collisions too often by 2 %": Defect(
        whole,
        "mean",
        Change("uniform(rng) * path->majorant,", "uniform(rng) * 0.98f * path->majorant,"),
        DELTA,
    ),
    "a distance that starts anew in each cell": Defect(
        whole, "mean", Change("draw = choose(crossing, larger(left, (real)0), draw);", ""), DELTA
    ),
    "the majorant of the cell beside": Defect(
        cleanness,
        "violations",
        Change("(j + 1) * row + (i + 1);", "j * row + (i + 1);"),
        DELTA | {"medium": "trilinear"},
    ),
    "a walk that leaves one cell too late": Defect(
        cleanness, "violations", Change("(SCALAR)1 - where,", "(SCALAR)2 - where,"), DELTA
    ),
    "a lookup counted twice": Defect(
        cost, "count", Change("count(path->lookups, here);", "path->lookups -= 2 * here;"), DELTA
    ),
    "a logarithm that is kept from its ends": Defect(
        whole,
        "mean|free path",
        Change("(SCALAR)1 - uniform(rng))", "(SCALAR)1 - uniform(rng) + (SCALAR)1e-2)"),
        ANALYTIC,
    ),
    "free paths of a bent distribution": Defect(
        distribution,
        "free path",
        Change(
            "return -logarithm((SCALAR)1 - uniform(rng));",
            "const real u = uniform(rng);\n"
            "return -logarithm((SCALAR)1 - u - 0.3f * u * (1.0f - u) * (1.0f - 2.0f * u));",
        ),
        ANALYTIC | {"medium": "homogeneous"},
    ),
    "one stream for all samples of a ray": Defect(
        whole,
        "varies|error",
        Change("{ray, low, high, (bits)0}", "{ray, (bits)0, high, (bits)0}"),
        RATIO,
    ),
    "one stream for all rays": Defect(
        whole,
        "independence|mean",
        Change("{ray, low, high, (bits)0}", "{(bits)0, low, high, (bits)0}"),
        RATIO,
    ),
    "samples numbered within their block": Defect(
        same_samples,
        "paths differ",
        Change("block * (index)(INTEGER)samples + tally->done;", "tally->done;"),
        RATIO,
    ),
    "midpoint steps that look up their start": Defect(
        order,
        "order",
        Change("path->t + (SCALAR)0.5 * length;", "path->t;"),
        {"medium": {"gaussian": {"sigma_t": 3, "width": 0.4}}, "lanes": 4},
    ),
    "a cubic integrated with a wrong coefficient": Defect(
        whole, "error", Change("(SCALAR)0.5 * cell.c1", "(SCALAR)0.45 * cell.c1"), REGULAR
    ),
    "the last cell of a ray left out": Defect(
        whole,
        "error",
        Change(
            "path->depth = choose(path->live, depth,",
            "path->depth = choose(path->live & less(t_exit, path->length), depth,",
        ),
        REGULAR | {"medium": "layered"},
    ),
    "a layer walked into beyond the last": Defect(
        cleanness,
        "truncated",
        Change("choose(flat | outermost | less(", "choose(flat | less("),
        {"tracker": "regular", "medium": "layered", "lanes": 1},
    ),
    "a root that is not waited for": Defect(
        each_path,
        "off by",
        Change("#define NEWTON_STEPS 64", "#define NEWTON_STEPS 4"),
        {"tracker": "analytic", "medium": "gaussian"},
    ),
    "a mean that stands still in float": Defect(
        thin_mean,
        "mean",
        Change("const real excess = mean - tally->mean - rise;", "const real excess = (real)0;"),
        RATIO | {"medium": {"homogeneous": {"sigma_t": 1e-5}}},
    ),
}


@pytest.mark.parametrize("name", DEFECTS)
def test_a_defect_is_found(rig, name):
    defect = DEFECTS[name]
    defect.check(rig, **defect.axes)
    with pytest.raises(AssertionError, match=defect.message):
        defect.check(rig.with_change(defect.change), **defect.axes)
    assert defect.change.planted


def test_a_defect_in_several_places_is_an_error(rig):
    with pytest.raises(LookupError, match="places"):
        rig.with_change(Change("path", "")).flight(**RATIO)
