"""Free paths follow their closed-form distribution: chi-square and Kolmogorov-Smirnov."""

import pytest
from freepath import catalog
from support.cases import cases_of, check_distribution, name_of
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
    assert (samples.weight == 1.0).all()
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
