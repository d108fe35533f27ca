"""Spectral tracking: every channel's mean, variance, free paths and cost, and bounded weights."""

import itertools

import numpy as np
import pytest
from freepath.check.identities import (
    check_clean,
    check_count,
    check_mean,
    check_same_samples,
    check_variance,
    check_weighted_free_path,
    sidak,
)
from freepath.check.truth import depth_at
from freepath.stats import Moments
from scipy import stats

SAMPLES = 4096
PROBABILITIES = ("maximum", "average", "history_maximum", "history_average")
CHANNELS = (1.0, 0.6, 0.25)
MEDIA = {
    "homogeneous": {"homogeneous": {"sigma_t": 1.5, "channels": CHANNELS}},
    "exponential": {"exponential": {"sigma_t": 4, "scale_height": 0.3, "channels": CHANNELS}},
    "trilinear": {"cloud": {"resolution": 16, "sigma_t": 8, "channels": CHANNELS}},
}


def each_channel(moments):
    """The moments of one channel after the other."""
    for channel in range(moments.mean.shape[1]):
        yield Moments(moments.count, moments.mean[:, channel], moments.m2[:, channel])


def spectral(rig, probability, medium, **axes):
    tracker = {"spectral": {"probability": probability}}
    medium = MEDIA[medium] if isinstance(medium, str) else medium
    axes = {"lanes": 16, "medium": medium} | axes
    return rig.flight(tracker=tracker, **axes)


CASES = list(itertools.product(PROBABILITIES, MEDIA, (1.0, 2.0, 0.8)))
ALPHA = sidak(1e-3, 3 * len(CASES))


@pytest.mark.parametrize(("probability", "medium", "tightness"), CASES)
def test_every_channel_is_unbiased(rig, probability, medium, tightness):
    flight = spectral(rig, probability, medium, tightness=tightness)
    one = flight.record(SAMPLES).round
    check_clean(one, bounded=tightness >= 1)
    reference = flight.reference()
    for channel, moments in enumerate(each_channel(one.moments)):
        check_mean(moments, reference[:, channel], ALPHA)


@pytest.mark.parametrize("majorant", ["grid", {"octree": {"resolution": 8}}])
@pytest.mark.parametrize("tracker", ["spectral", "spectral_ratio"])
def test_local_majorants(rig, tracker, majorant):
    flight = rig.flight(tracker=tracker, medium=MEDIA["trilinear"], majorant=majorant, lanes=1)
    moments = flight.record(SAMPLES).round.moments
    for channel, one in enumerate(each_channel(moments)):
        check_mean(one, flight.reference()[:, channel], ALPHA)


@pytest.mark.parametrize("probability", PROBABILITIES)
def test_weighted_free_paths_of_every_channel(rig, probability):
    flight = spectral(rig, probability, "exponential", estimand="free_path", tightness=1.5)
    samples = flight.record(2048)
    ends = depth_at(flight.medium, flight.segments, samples.t)
    whole = flight.medium.optical_depth(flight.segments)
    for factor, weight in zip(CHANNELS, samples.weights, strict=True):
        check_weighted_free_path(factor * ends, weight, samples.escaped, factor * whole, ALPHA)


class Chain:
    """What spectral tracking does in a homogeneous medium, in float64.

    The k-th null collision always finds the same weights, so the chances of ending at the k-th
    tentative collision and the weights after it are numbers; how many tentative collisions a ray
    has is a Poisson number.
    """

    def __init__(self, probability, sigma, majorant, most=200):
        join = np.max if probability.endswith("maximum") else np.mean
        weight, self.weights, self.null = np.ones(len(sigma)), [], []
        for _ in range(most):
            self.weights.append(weight)
            history = np.abs(weight) if probability.startswith("history") else 1.0
            ends, null = join(history * sigma), join(history * np.abs(majorant - sigma))
            self.null.append(null / (ends + null))
            weight = weight * (majorant - sigma) / majorant * (ends + null) / null
        self.reached = np.cumprod([1.0, *self.null[:-1]])
        self.count = np.arange(most)

    def second_moment(self, mean_count):
        """Of the weight of what escapes, (rays, channels), for Poisson means (rays,)."""
        chance = stats.poisson.pmf(self.count, mean_count[:, None]) * self.reached
        return chance @ np.square(self.weights)

    def lookups(self, mean_count):
        """A lookup at every tentative collision that is reached, (rays,)."""
        return (stats.poisson.sf(self.count, mean_count[:, None]) * self.reached).sum(axis=1)


@pytest.mark.parametrize("tightness", [1.25, 2.0, 0.8])
@pytest.mark.parametrize("probability", PROBABILITIES)
def test_variance_and_lookups(rig, probability, tightness):
    flight = spectral(rig, probability, "homogeneous", tightness=tightness)
    majorant = 1.5 * tightness
    chain = Chain(probability, 1.5 * np.array(CHANNELS), majorant)
    mean_count = majorant * flight.segments[:, 6]
    samples = flight.record(SAMPLES)
    check_count(samples.lookups, chain.lookups(mean_count), ALPHA)
    variance = chain.second_moment(mean_count) - flight.reference() ** 2
    for channel, scores in enumerate(samples.scores):
        check_variance(scores, variance[:, channel], ALPHA)


def test_ratio_of_every_channel_has_the_variance_of_ratio_tracking(rig):
    flight = rig.flight(tracker="spectral_ratio", medium=MEDIA["homogeneous"], lanes=16)
    samples = flight.record(SAMPLES)
    length = flight.segments[:, 6]
    check_count(samples.lookups, 1.5 * length, ALPHA)
    for factor, scores in zip(CHANNELS, samples.scores, strict=True):
        sigma = 1.5 * factor
        expected = np.exp(-2 * sigma * length) * np.expm1(sigma**2 / 1.5 * length)
        check_variance(scores, expected, ALPHA)


@pytest.mark.parametrize("estimand", ["transmittance", "free_path"])
@pytest.mark.parametrize("probability", PROBABILITIES)
def test_one_channel_is_delta_tracking(rig, probability, estimand):
    axes = {"estimand": estimand, "majorant": "grid", "tightness": 1.5}
    one = rig.flight(
        tracker={"spectral": {"probability": probability}}, medium="trilinear", lanes=16, **axes
    )
    other = rig.flight(tracker="delta", medium="trilinear", lanes=16, **axes)
    one, other = one.record(256), other.record(256)
    scores = one.score, other.score
    check_same_samples(*scores, (one.lookups, other.lookups), 2.0**-24)


@pytest.mark.parametrize("factors", [(1.0, 0.001), (1.0, 0.03, 0.001, 0.0)])
def test_history_keeps_weights_bounded(rig, factors):
    """The average of the weights stays 1 where the majorant bounds, so none exceeds the channels.

    Without history a thin channel's weight multiplies by up to the ratio of the extinctions.
    """
    medium = {"homogeneous": {"sigma_t": 3, "channels": factors}}
    bounded, other = (
        spectral(rig, probability, medium, estimand="free_path").record(2048)
        for probability in ("history_average", "average")
    )
    np.testing.assert_allclose(bounded.weights.mean(axis=0), 1.0, rtol=1e-4)
    assert bounded.weights.min() >= 0.0
    assert bounded.weights.max() < len(factors) * 1.0001
    assert other.weights.max() > 2 * len(factors)


def test_a_channel_of_nothing_passes_and_one_of_little_keeps_its_mean(rig):
    flight = spectral(
        rig, "history_average", {"homogeneous": {"sigma_t": 3, "channels": [1, 1e-3, 0]}}
    )
    samples = flight.record(SAMPLES)
    check_clean(samples.round, bounded=True)
    for channel, moments in enumerate(each_channel(samples.round.moments)):
        check_mean(moments, flight.reference()[:, channel], ALPHA)
    assert (flight.reference()[:, 2] == 1.0).all()


def test_the_error_of_the_mean_knows_that_channels_are_correlated(rig):
    samples = spectral(rig, "history_average", "homogeneous").record(SAMPLES)
    moments = samples.round.moments
    expected = samples.scores.mean(axis=0).var(axis=1, ddof=1)
    np.testing.assert_allclose(moments.joint_variance, expected, rtol=1e-3)
    independent = moments.variance.mean(axis=1) / len(CHANNELS)
    assert moments.joint_variance.mean() > 1.2 * independent.mean()
    halves = [
        spectral(rig, "history_average", "homogeneous").run(SAMPLES // 2, first_sample=first)
        for first in (0, SAMPLES // 2)
    ]
    merged = halves[0].moments.merged(halves[1].moments)
    np.testing.assert_allclose(merged.joint_variance, expected, rtol=1e-3)


@pytest.mark.parametrize("change", ["history", "probability", "channel"])
def test_a_defect_is_found(rig, change):
    """A weight without the majorant's share, a probability not divided by, channels swapped."""
    from freepath.check.rig import Change

    changes = {
        "history": Change(
            "const real scale = (ends + null)", "const real scale = (SCALAR)0.98 * (ends + null)"
        ),
        "probability": Change(
            "(choose(collided, ends, null) * path->majorant)", "(null * path->majorant)"
        ),
        "channel": Change(
            "const real extinction = sigma * scene->channels.extinction[c];",
            "const real extinction = sigma * scene->channels.extinction[CHANNELS - 1 - c];",
        ),
    }
    flight = spectral(
        rig,
        "history_average",
        "homogeneous",
        tightness=1.5,
        change=changes[change],
        estimand="free_path",
    )
    moments = flight.record(SAMPLES).round.moments
    with pytest.raises(AssertionError, match="mean"):
        for channel, one in enumerate(each_channel(moments)):
            check_mean(one, flight.reference()[:, channel], ALPHA)
