"""What must hold for a case of any tracker, whatever it is."""

from __future__ import annotations

from typing import Any

import numpy as np

from freepath.checks.identities import (
    RESOLVED,
    check_clean,
    check_empty,
    check_exact,
    check_free_path,
    check_independence,
    check_inversion,
    check_mean,
    check_weighted_free_path,
    largest_events,
    noise_of,
    roundings,
    violations_by_rounding,
)
from freepath.checks.rig import Flight, Rig
from freepath.checks.samples import Samples
from freepath.checks.truth import depth_at
from freepath.checks.verdict import demand

Axes = dict[str, Any]

MANY = 100  # rays over which a sum is close enough to a normal distribution
DISTRIBUTED = 128  # samples of each ray of which the depth is looked up: that is dear in a grid
VARIES = 100.0  # roundings that a sample may be off
MORE = (8, 32)  # times as many samples
COARSE = 0.05  # what a tracker that says it is biased may be off with its default parameters


def check_case(rig: Rig, axes: Axes, alpha: float, samples: int = 2048, **options: Any) -> None:
    """Build a case, take samples, and hold them against the exact values."""
    flight = rig.flight(**axes, **options)
    check_samples(flight, flight.record(samples), alpha)


def check_samples(flight: Flight, samples: Samples, alpha: float) -> None:
    """All that must hold for samples of any tracker."""
    tracker, case, samples = flight.tracker, flight.case, _resolved(flight, samples)
    bounded = case.majorant is not None and case.tightness >= 1
    check_clean(samples.round, bounded=bounded, violations=_by_rounding(flight, samples, alpha))
    expected, moments = flight.reference(), samples.round.moments
    depth = flight.depth
    if case.estimand == "transmittance":
        check_empty(moments, depth, flight.rounding)
    if not tracker.unbiased:
        bias = float(np.sqrt(np.mean((moments.mean - expected) ** 2)))
        demand(bias < COARSE, f"bias {bias:.3g}, expected below {COARSE}")
    elif 0.0 < samples.round.variance < (VARIES * flight.rounding * expected.mean()) ** 2:
        # an estimator whose variance vanishes here, and whose samples differ by rounding alone
        error = np.max(np.abs(moments.mean / expected - 1.0))
        demand(error <= VARIES * flight.rounding, f"error {error:.3g} of an all but exact mean")
    elif samples.round.variance == 0.0:
        pieces = _pieces(flight)
        check_exact(moments, expected, flight.rounding, _largest_depth(flight), pieces)
    else:
        check_mean(moments, expected, alpha / 3, largest_events(samples.score))
        if len(expected) > MANY:
            check_independence(samples.score, alpha / 3)
        if case.estimand == "free_path" and ends_where_it_scores(samples):
            check_distribution(flight, samples, alpha / 3, DISTRIBUTED)


def _pieces(flight: Flight) -> np.ndarray:
    return np.count_nonzero(flight.medium.pieces(flight.segments).length, axis=1)


def _largest_depth(flight: Flight) -> np.ndarray:
    """A bound of the optical depth of each ray that takes no rounding into account."""
    upper = flight.medium.bounds((1, 1, 1))[1].max()
    speed = np.linalg.norm(flight.segments[:, 3:6], axis=1)
    return upper * np.sqrt((flight.medium.extent**2).sum()) / speed


def ends_where_it_scores(samples: Samples) -> bool:
    """Whether the end of a flight is a free path, and its weight that of it."""
    return np.allclose(samples.score, samples.weight * samples.t, rtol=1e-6, atol=1e-30)


def _resolved(flight: Flight, samples: Samples) -> Samples:
    """More of them, where a few rare high weights leave the mean all but unknown.

    And more again: one weight in a million may come among those, and be most of the noise.
    """
    expected, count = flight.reference(), samples.score.shape[1]
    for times in MORE:
        # a noise that is no number is for the tests to find
        if not noise_of(samples.round.moments, expected) > RESOLVED / 2:
            break
        samples = flight.record(count, blocks=times)
    return samples


def _by_rounding(flight: Flight, samples: Samples, alpha: float) -> int:
    """How many violations of the majorants of cells are no fault in constant voxels."""
    medium, majorant = flight.medium, flight.case.majorant
    if majorant is None or majorant.kind == "global" or medium.kernel != "grid_nearest":
        return 0
    lookups = samples.round.counters["lookups"]
    return violations_by_rounding(lookups, int(max(medium.extent)), flight.rounding, alpha)


def check_distribution(
    flight: Flight, samples: Samples, alpha: float, at_most: int | None = None
) -> None:
    """Free paths have the distribution that the medium gives them; `at_most` samples a ray."""
    depth = flight.depth
    at = depth_at(flight.medium, flight.segments, samples.t[:, :at_most])
    weight, escaped = samples.weight[:, :at_most], samples.escaped[:, :at_most]
    if (weight == 1.0).all():
        check_free_path(at, escaped, depth, alpha)
    else:
        check_weighted_free_path(at, weight, escaped, depth, alpha)


def check_each_path(flight: Flight, samples: Samples, target: np.ndarray) -> None:
    """Free paths end where the optical depths that were sampled for them are reached."""
    depth = flight.depth
    at = depth_at(flight.medium, flight.segments, samples.t)
    bound = flight.rounding * roundings(_pieces(flight)) * np.maximum(_largest_depth(flight), 1.0)
    check_inversion(at, target, samples.escaped, depth, bound)
