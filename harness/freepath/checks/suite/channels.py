"""Spectral tracking: mean, variance, free paths and cost of every channel, and bounded weights."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from scipy import stats

from freepath.checks.identities import (
    check_clean,
    check_count,
    check_mean,
    check_same_samples,
    check_variance,
    check_weighted_free_path,
)
from freepath.checks.rig import Flight, Rig
from freepath.checks.suite.common import Checks
from freepath.checks.truth import depth_at
from freepath.checks.verdict import demand
from freepath.measure.stats import Moments

GROUP = "channels"
SAMPLES = 4096
PROBABILITIES = ("maximum", "average", "history_maximum", "history_average")
CHANNELS = (1.0, 0.6, 0.25)
MEDIA = {
    "homogeneous": {"homogeneous": {"sigma_t": 1.5, "channels": CHANNELS}},
    "exponential": {"exponential": {"sigma_t": 4, "scale_height": 0.3, "channels": CHANNELS}},
    "trilinear": {"cloud": {"resolution": 16, "sigma_t": 8, "channels": CHANNELS}},
}
MAJORANTS = {"grid": "grid", "octree": {"octree": {"resolution": 8}}}
UNEQUAL = {"1-1000": (1.0, 1e-3), "of-nothing": (1.0, 0.03, 1e-3, 0.0)}
checks = Checks()


def _fly(rig: Rig, probability: str, **axes: Any) -> Flight:
    tracker = {"spectral": {"probability": probability}}
    return rig.flight(**{"tracker": tracker, "lanes": 16} | axes)


def check_channels(moments: Moments, expected: np.ndarray, alpha: float) -> None:
    """The mean of each channel; of one that is the same for all samples, exactly."""
    for channel, wanted in enumerate(expected.T):
        one = Moments(moments.count, moments.mean[:, channel], moments.m2[:, channel])
        check_mean(one, wanted, alpha / expected.shape[1])


def check_any(moments: Moments, expected: np.ndarray, alpha: float) -> None:
    """The mean of one channel or of each."""
    (check_mean if moments.mean.ndim == 1 else check_channels)(moments, expected, alpha)


def mean(rig: Rig, alpha: float, probability: str, axes: dict[str, Any]) -> None:
    """One path serves all channels: a weight that is another channel's, or not divided by the
    probability of what happened, biases some of them and leaves the first right."""
    flight = _fly(rig, probability, **axes)
    found = flight.record(SAMPLES).round
    check_clean(found, bounded=axes["tightness"] >= 1)
    check_channels(found.moments, flight.reference(), alpha)


def local(rig: Rig, alpha: float, tracker: str, majorant: Any) -> None:
    """Majorants of a cell are those of the densest channel; another one's is violated."""
    flight = rig.flight(tracker=tracker, medium=MEDIA["trilinear"], majorant=majorant, lanes=1)
    found = flight.record(SAMPLES).round
    check_clean(found, bounded=True)
    check_channels(found.moments, flight.reference(), alpha)


def free_path(rig: Rig, alpha: float, probability: str) -> None:
    """The path ends where one channel would; in each its weighted ends must be spread as that
    channel's free paths are."""
    axes = {"medium": MEDIA["exponential"], "estimand": "free_path", "tightness": 1.5}
    flight = _fly(rig, probability, **axes)
    samples = flight.record(SAMPLES)
    check_channels(samples.round.moments, flight.reference(), alpha / 2)
    ends = depth_at(flight.medium, flight.segments, samples.t)
    whole, level = flight.depth, alpha / 2 / len(CHANNELS)
    for factor, weight in zip(CHANNELS, samples.weights, strict=True):
        check_weighted_free_path(factor * ends, weight, samples.escaped, factor * whole, level)


class Chain:
    """What spectral tracking does in a homogeneous medium, in float64.

    The k-th null collision always finds the same weights, so the chances of ending at the k-th
    tentative collision and the weights after it are numbers; how many tentative collisions a ray
    has is a Poisson number.
    """

    def __init__(self, probability: str, sigma: np.ndarray, majorant: float, most: int = 200):
        join = np.max if probability.endswith("maximum") else np.mean
        weight, weights, nulls = np.ones(len(sigma)), [], []
        for _ in range(most):
            weights.append(weight)
            history = np.abs(weight) if probability.startswith("history") else 1.0
            ends, null = join(history * sigma), join(history * np.abs(majorant - sigma))
            nulls.append(null / (ends + null))
            weight = weight * (majorant - sigma) / majorant * (ends + null) / null
        self.weights = np.array(weights)
        self.reached = np.cumprod([1.0, *nulls[:-1]])
        self.count = np.arange(most)

    def second_moment(self, mean_count: np.ndarray) -> np.ndarray:
        """Of the weight of what escapes, (rays, channels), for Poisson means (rays,)."""
        chance = stats.poisson.pmf(self.count, mean_count[:, None]) * self.reached
        return chance @ np.square(self.weights)

    def lookups(self, mean_count: np.ndarray) -> np.ndarray:
        """A lookup at every tentative collision that is reached, (rays,)."""
        return (stats.poisson.sf(self.count, mean_count[:, None]) * self.reached).sum(axis=1)


def variance(rig: Rig, alpha: float, probability: str, tightness: float) -> None:
    """Another probability than the one named keeps the mean and changes variance and cost: both
    follow from a chain of weights."""
    # Variances and lookups of the chain.
    flight = _fly(rig, probability, medium=MEDIA["homogeneous"], tightness=tightness)
    majorant = 1.5 * tightness
    chain = Chain(probability, 1.5 * np.array(CHANNELS), majorant)
    mean_count = majorant * flight.segments[:, 6]
    samples, level = flight.record(SAMPLES), alpha / (len(CHANNELS) + 1)
    check_count(samples.lookups, chain.lookups(mean_count), level)
    expected = chain.second_moment(mean_count) - flight.reference() ** 2
    for channel, scores in enumerate(samples.scores):
        check_variance(scores, expected[:, channel], level)


def ratio_variance(rig: Rig, alpha: float) -> None:
    """Every channel has the variance of ratio tracking."""
    flight = rig.flight(tracker="spectral_ratio", medium=MEDIA["homogeneous"], lanes=16)
    samples, length = flight.record(SAMPLES), flight.segments[:, 6]
    level = alpha / (len(CHANNELS) + 1)
    check_count(samples.lookups, 1.5 * length, level)
    for factor, scores in zip(CHANNELS, samples.scores, strict=True):
        sigma = 1.5 * factor
        expected = np.exp(-2 * sigma * length) * np.expm1(sigma**2 / 1.5 * length)
        check_variance(scores, expected, level)


def one(rig: Rig, alpha: float, probability: str, estimand: str) -> None:
    """With one channel every probability is delta tracking, sample for sample."""
    # Delta tracking, sample for sample.
    axes = {"estimand": estimand, "majorant": "grid", "tightness": 1.5, "medium": "trilinear"}
    first = _fly(rig, probability, **axes).record(256)
    other = rig.flight(tracker="delta", lanes=16, **axes).record(256)
    lookups = first.lookups, other.lookups
    check_same_samples(first.score, other.score, lookups, 2.0**-24)


def bounded(rig: Rig, alpha: float, factors: tuple[float, ...]) -> None:
    """Without their history, weights of thin channels multiply without end; their average, which
    history keeps at 1, bounds them by the number of channels."""
    medium = {"homogeneous": {"sigma_t": 3, "channels": factors}}
    kept, other = (
        _fly(rig, probability, medium=medium, estimand="free_path").record(2048).weights
        for probability in ("history_average", "average")
    )
    error = np.max(np.abs(kept.mean(axis=0) - 1.0))
    demand(error < 1e-4, f"the average of the weights is off by {error:.3g}")
    bound = len(factors) * 1.0001
    demand(kept.min() >= 0.0 and kept.max() < bound, f"a weight of {kept.max():.4g}")
    demand(other.max() > 2 * len(factors), "weights without history are bounded too")


def unequal(rig: Rig, alpha: float, tracker: str, factors: tuple[float, ...]) -> None:
    """A channel of a thousandth, or of nothing, has its mean where others end the path."""
    medium = {"homogeneous": {"sigma_t": 3, "channels": factors}}
    flight = rig.flight(tracker=tracker, medium=medium, lanes=16)
    found, expected = flight.record(SAMPLES).round, flight.reference()
    check_clean(found, bounded=True)
    check_channels(found.moments, expected, alpha)


def albedo(rig: Rig, alpha: float, probability: str) -> None:
    """Albedos that are swapped, or the first for all, change colours alone: each channel must have
    its own, and an albedo of 0 no light at all."""
    # Single scattering of three channels, with an albedo of 1, a half and 0.
    keys = {"channels": [1, 0.6, 0.3], "albedo": [1.0, 0.5, 0.0]}
    light = {"point": {"position": [0.3, 0.4, 2.0], "intensity": [10, 5, 5]}}
    axes = {"light": light, "scatterings": 1, "shadow": "spectral_ratio", "estimand": "radiance"}
    medium = {"homogeneous": {"sigma_t": 2.0, **keys}}
    flight = _fly(rig, probability, medium=medium, **axes)
    found = flight.run(2 * SAMPLES)
    check_clean(found, bounded=True)
    demand(not found.moments.mean[:, 2].any(), "a channel without albedo scatters")
    colours = Moments(found.moments.count, found.moments.mean[:, :2], found.moments.m2[:, :2])
    check_channels(colours, flight.reference()[:, :2], alpha)


def _declare() -> None:
    for probability, tightness in itertools.product(PROBABILITIES, (1.0, 2.0, 0.8)):
        for medium, given in MEDIA.items():
            axes = {"medium": given, "tightness": tightness}
            name = f"mean/{medium}-{tightness}/{probability}"
            _one(name, mean, medium, probability=probability, axes=axes)
    for probability, tightness in itertools.product(PROBABILITIES, (1.25, 2.0, 0.8)):
        name, options = f"variance/{tightness}/{probability}", {"tightness": tightness}
        _one(name, variance, "homogeneous", probability=probability, **options)
    for tracker, majorant in itertools.product(("spectral", "spectral_ratio"), MAJORANTS):
        options = {"tracker": tracker, "majorant": MAJORANTS[majorant]}
        _one(f"local/{majorant}/{tracker}", local, majorant, **options)
    for probability in PROBABILITIES:
        given = {"probability": probability}
        _one(f"free-path/{probability}", free_path, "free-path", **given)
        for estimand in ("transmittance", "free_path"):
            _one(f"one/{estimand}/{probability}", one, "one", estimand=estimand, **given)
    for name, factors in UNEQUAL.items():
        _one(f"bounded/{name}", bounded, "free-path", factors=factors)
        for tracker in ("spectral", "spectral_ratio"):
            options = {"factors": factors, "tracker": tracker}
            _one(f"unequal/{name}/{tracker}", unequal, "homogeneous", **options)
    for probability in ("history_average", "average"):
        _one(f"albedo/{probability}", albedo, "albedo", probability=probability)
    _one("variance/spectral_ratio", ratio_variance, "homogeneous", sentence=variance.__doc__)


def _one(name: str, situation: Any, kernels: str, **options: Any) -> None:
    tracker = "spectral_ratio" if name.endswith("spectral_ratio") else "spectral"
    shared = f"{GROUP}/{kernels}/{options.get('probability', tracker)}"
    options.pop("tracker", None)
    checks.one(f"{GROUP}/{name}", tracker, kernels=shared, **options)(situation)


_declare()
