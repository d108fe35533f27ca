"""Relatives that differ in form only; the bias of those that need a majorant that bounds."""

import numpy as np
import pytest
from freepath.check.identities import check_mean
from freepath.check.suite.expectations import AlongRays
from freepath.check.verdict import sidak

SAMPLES = 4096
ALPHA = 1e-4


@pytest.mark.parametrize(
    ("tracker", "relative"),
    [
        ({"weighted_delta": {"probability": "analog"}}, "delta"),
        ({"split": {}}, "ratio"),
        ({"decomposition": {"share": 0}}, "delta"),
        ({"residual_ratio": {"share": 0}}, "ratio"),
    ],
)
def test_equal_to_its_relative_sample_for_sample(rig, tracker, relative):
    """What only changes in form must not change a single flight."""
    one, other = (
        rig.flight(tracker=t, medium="trilinear", majorant="grid", lanes=16).record(256)
        for t in (tracker, relative)
    )
    assert (one.lookups == other.lookups).mean() > 1 - 1e-5
    same = one.lookups == other.lookups
    np.testing.assert_allclose(one.score[same], other.score[same], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("tracker", ["delta", "decomposition", "track_length", "next_flight_delta"])
def test_a_lower_majorant_gives_the_predicted_bias(rig, tracker):
    """What plays sigma / majorant as a probability estimates exp(-integral of min(sigma, M))."""
    flight = rig.flight(tracker=tracker, medium="exponential", tightness=0.5, lanes=16)
    along = AlongRays(flight)
    samples = flight.record(SAMPLES)
    assert samples.round.counters["violations"] > 0
    if tracker in ("delta", "decomposition"):
        capped = np.minimum(along.sigma - along.control, along.majorant) + along.control
        check_mean(samples.round.moments, np.exp(-along.integral(capped)), ALPHA)
    bias = samples.round.moments.mean.mean() - flight.reference().mean()
    assert abs(bias) > 0.01


@pytest.mark.parametrize("majorant", ["grid", {"octree": {"resolution": 8}}])
@pytest.mark.parametrize("tracker", ["delta", "residual_ratio", "weighted_decomposition"])
def test_local_majorants_and_controls_keep_the_mean(rig, tracker, majorant):
    flight = rig.flight(tracker=tracker, medium="trilinear", majorant=majorant, lanes=16)
    check_mean(flight.record(SAMPLES).round.moments, flight.reference(), sidak(1e-3, 6))
