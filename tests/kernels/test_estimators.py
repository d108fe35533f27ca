"""Mean, variance and lookups of the null-collision relatives agree with docs/estimators.md."""

import numpy as np
import pytest

from freepath.checks.identities import check_count, check_mean, check_variance
from freepath.checks.verdict import sidak
from freepath.measure.stats import Moments
from support.derivations import (
    AlongRays,
    Chain,
    NextFlight,
    Series,
    TrackLength,
    delta,
    extinction,
    ratio,
    two_knob,
)
from support.march_moments import Telescoping, UnbiasedMarch

SAMPLES = 2048
# Tails too heavy for a sample variance: rays that are thicker, or whose fourth central moment is
# more than this times the variance squared (of a normal distribution it is 3).
THICKEST, HEAVIEST = 2.0, SAMPLES / 32

WEIGHTED = [
    ({"weighted_delta": {}}, two_knob(1.0)),
    ({"weighted_delta": {"probability": "no_absorption"}}, two_knob(0.8)),
    ({"two_knob": {"acceptance": 0.3}}, two_knob(0.3)),
    ({"two_knob": {"acceptance": 3}}, two_knob(3.0)),
    ("ratio", ratio),
    ({"split": {}}, ratio),
    ({"residual_ratio": {}}, ratio),
    ({"residual_ratio": {"control": "minorant", "share": 1.2}}, ratio),
    ({"weighted_decomposition": {"share": 0.3}}, two_knob(1.0)),
    ({"next_flight_ratio": {}}, lambda along: NextFlight(ratio(along))),
    ("p_series_cmf", Series),
    ("unbiased_march", UnbiasedMarch),
]
# without a majorant
MARCHED = [
    ({"telescoping_march": {"steps": 3, "ratio": 0.1}}, Telescoping),
    ({"telescoping_march": {"steps": 2, "ratio": 0.3}}, Telescoping),
    ({"telescoping_march": {"steps": 1, "ratio": 0.2}}, Telescoping),
]
TRACK_LENGTH = ({"track_length": {}}, lambda along: TrackLength(delta(along)))
PLAYED = [
    ("delta", delta),
    ({"weighted_delta": {"probability": "analog"}}, delta),
    ({"decomposition": {}}, delta),
    ({"next_flight_delta": {}}, lambda along: NextFlight(delta(along))),
    TRACK_LENGTH,
]
# those whose second moment is no product: on more media
LAST = [TRACK_LENGTH, WEIGHTED[-1], MARCHED[0]]
BELOW, BOUNDING = (0.5, 0.8), (1, 1.25, 2, 4, 10)
CASES = [
    *((*case, "exponential", BELOW + BOUNDING) for case in WEIGHTED),
    *((*case, "exponential", BELOW + BOUNDING) for case in PLAYED),
    *((*case, "trilinear", (1.5,)) for case in WEIGHTED + PLAYED),
    *((*case, medium, (1,)) for case in MARCHED for medium in ("exponential", "trilinear")),
    (*TRACK_LENGTH, "homogeneous", BELOW + BOUNDING),
    *((*case, medium, (1.25,)) for case in LAST for medium in ("linear", "gaussian", "cosine")),
]
# mean, variance and lookups of each
ALPHA = sidak(1e-3, 3 * sum(len(tightness) for *_, tightness in CASES))


@pytest.fixture(scope="module")
def sigma():
    """The extinction along the rays of each medium: the slowest part of what is expected."""
    return {}


def fly(rig, sigma, tracker, medium, tightness):
    flight = rig.flight(tracker=tracker, medium=medium, tightness=tightness, lanes=16)
    if medium not in sigma:
        sigma[medium] = extinction(flight.medium, flight.segments)
    return flight, AlongRays(flight, sigma[medium])


def judged(expected):
    """The rays whose samples have no heavy tail, as far as that is known."""
    if not isinstance(expected, Chain):
        return np.ones(len(expected.moment(1)), bool)
    with np.errstate(over="ignore", invalid="ignore"):
        first, second, third, fourth = (expected.moment(power) for power in (1, 2, 3, 4))
        variance = second - first**2
        central = fourth - 4.0 * third * first + 6.0 * second * first**2 - 3.0 * first**4
        return central < HEAVIEST * variance**2


@pytest.mark.parametrize(
    ("tracker", "derivation", "medium", "tightness"),
    [(t, d, medium, each) for t, d, medium, several in CASES for each in several],
)
def test_mean_variance_and_lookups(rig, sigma, tracker, derivation, medium, tightness):
    """Below 1 too: there what plays sigma / majorant as a chance has a bias, which is predicted."""
    flight, along = fly(rig, sigma, tracker, medium, tightness)
    expected = derivation(along)
    samples = flight.record(SAMPLES)
    check_count(samples.lookups, expected.lookups(), ALPHA)
    rays = judged(expected)
    assert np.count_nonzero(rays) >= 32
    moments = samples.round.moments
    judgeable = Moments(moments.count, moments.mean[rays], moments.m2[rays])
    check_mean(judgeable, expected.moment(1)[rays], ALPHA)
    rays &= along.depth <= THICKEST
    variance = expected.moment(2) - expected.moment(1) ** 2
    check_variance(samples.score[rays], variance[rays], ALPHA)
    bias = expected.moment(1) - flight.reference()
    if tightness >= 1 or (tracker, derivation) not in PLAYED:
        assert abs(bias).max() < 1e-4  # of the midpoint rule
    else:
        assert samples.round.counters["violations"] > 0
        assert abs(bias.mean()) > {0.5: 0.01, 0.8: 0.001}[tightness]


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


@pytest.mark.parametrize(
    ("threshold", "relative", "estimand"),
    [(0, "delta", "transmittance"), (2, "regular", "transmittance"), (2, "regular", "free_path")],
)
def test_hybrid_is_delta_or_regular(rig, threshold, relative, estimand):
    axes = {"medium": "layered", "estimand": estimand, "lanes": 16, "majorant": "global"}
    one = rig.flight(tracker={"hybrid": {"threshold": threshold}}, **axes).record(256)
    other = rig.flight(tracker=relative, **axes).record(256)
    assert (one.lookups == other.lookups).mean() > 1 - 1e-5
    np.testing.assert_allclose(one.score, other.score, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("majorant", ["grid", {"octree": {"resolution": 8}}])
@pytest.mark.parametrize("tracker", ["delta", "residual_ratio", "weighted_decomposition"])
def test_local_majorants_and_controls_keep_the_mean(rig, tracker, majorant):
    flight = rig.flight(tracker=tracker, medium="trilinear", majorant=majorant, lanes=16)
    check_mean(flight.record(SAMPLES).round.moments, flight.reference(), sidak(1e-3, 6))
