"""Free paths follow their closed-form distribution: chi-square and Kolmogorov-Smirnov."""

import pytest
from freepath import catalog
from support.cases import (
    cases_of,
    check_distribution,
    check_each_path,
    ends_where_it_scores,
    name_of,
)
from support.identities import sidak

TRACKERS = [t for t in catalog.load().trackers.values() if t.unbiased]
CASES = [
    axes | {"tightness": 3}
    for tracker in TRACKERS
    for axes in cases_of(tracker)
    if axes["estimand"] == "free_path"
]
ALPHA = sidak(1e-3, len(CASES))


@pytest.mark.parametrize("axes", CASES, ids=name_of)
def test_distribution(rig, axes):
    """With looser majorants, another seed and more samples than there."""
    flight = rig.flight(**axes, seed=77)
    samples = flight.record(512)
    if not ends_where_it_scores(samples):
        pytest.skip("scores on the way, so that the end of its flight is no free path")
    check_distribution(flight, samples, ALPHA)


def test_delta_in_a_transmittance_kernel(rig):
    """Where a path of delta tracking ends does not depend on what is asked of it."""
    flight = rig.flight(tracker="delta", medium="trilinear", majorant="grid", lanes=16)
    samples = flight.record(1024)
    check_distribution(flight, samples, ALPHA)
    other = rig.flight(
        tracker="delta", medium="trilinear", majorant="grid", lanes=16, estimand="free_path"
    )
    assert (samples.t == other.record(1024).t).all()


SAMPLES = 256
# Homogeneous and so large that the analytic tracker's distance is the optical depth that it drew.
DEPTHS = {"homogeneous": {"sigma_t": 1, "size": 1000}}
DRAW_FIRST = [axes for axes in CASES if axes["tracker"] in ("analytic", "regular")]
# the layers' boundaries are rounded to float32 for the kernel whatever its arithmetic
IN_DOUBLE = [
    axes | {"arithmetic": "double", "lanes": 4}
    for axes in DRAW_FIRST
    if axes["medium"] in ("gaussian", "cosine", "trilinear")
]


@pytest.fixture(scope="module")
def depths(rig):
    rays = {"orthographic": {"resolution": 16}}
    axes = {"estimand": "free_path", "arithmetic": "double", "lanes": 4}
    flight = rig.flight(tracker="analytic", medium=DEPTHS, rays=rays, **axes)
    samples = flight.record(SAMPLES)
    assert not samples.escaped.any()
    return samples.t


@pytest.mark.parametrize("axes", DRAW_FIRST + IN_DOUBLE, ids=name_of)
def test_each_path(rig, depths, axes):
    """Path by path: it ends where the depth is reached that was drawn for it."""
    flight = rig.flight(**axes)
    check_each_path(flight, flight.record(SAMPLES), depths)
