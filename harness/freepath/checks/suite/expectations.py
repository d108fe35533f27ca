"""Second moments and lookups of the estimators, as docs/estimators.md derives them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from freepath.checks.rig import Flight
from freepath.scene import majorants

Array = NDArray[np.float64]
Expected = tuple[Array | None, Array]
"""The mean of the squared score, where it has a formula, and of the lookups: of each ray."""

POINTS = 2048
"""Of the midpoint rule along a ray: its error is far below that of the samples."""


class AlongRays:
    """sigma_t at midpoints of equal intervals of each ray, with the majorant and control there."""

    def __init__(self, flight: Flight):
        segments = flight.segments
        self.step = segments[:, 6:] / POINTS
        t = (np.arange(POINTS) + 0.5) * self.step
        points = segments[:, None, :3] + t[..., None] * segments[:, None, 3:6]
        self.sigma = flight.medium.sigma_t(points.reshape(-1, 3)).reshape(t.shape)
        case = flight.case
        control = case.params if "control" in flight.tracker.needs else None
        bounds = flight.medium.bounds((1, 1, 1))
        numbers = majorants.build(
            case.majorant, flight.medium, bounds, case.tightness, control
        ).numbers
        self.majorant = numbers.get("sigma_t", numbers.get("residual"))
        self.control = numbers.get("control", 0.0)

    def integral(self, values: Array) -> Array:
        """Of values at the midpoints."""
        return (values * self.step).sum(axis=1)

    def until(self, rate: Array, end_rate: Array) -> Array:
        """The integral of a rate over the paths that an end rate has not ended."""
        ended = np.cumsum(end_rate * self.step, axis=1) - 0.5 * end_rate * self.step
        return self.integral(rate * np.exp(-ended))

    @property
    def transmittance(self) -> Array:
        """Of each ray."""
        return np.exp(-self.integral(self.sigma))


def binary(along: AlongRays) -> Expected:
    """Delta tracking, of the residual where there is a control: 0 or 1."""
    rate = np.full_like(along.sigma, along.majorant)
    return along.transmittance, along.until(rate, along.sigma)


def ratio(along: AlongRays) -> Expected:
    """Ratio tracking."""
    square = along.integral(along.sigma**2 / along.majorant)
    return along.transmittance**2 * np.exp(square), along.integral(0 * along.sigma + along.majorant)


def free(acceptance: float, albedo: float = 1.0) -> Callable[[AlongRays], Expected]:
    """two_knob: real collisions with odds acceptance * sigma / |sigma_n|."""

    def expected(along: AlongRays) -> Expected:
        null = np.abs(along.majorant - along.sigma)
        real = acceptance * albedo * along.sigma
        second = np.exp(along.integral(null * (real + null) / along.majorant - along.majorant))
        rate = np.full_like(along.sigma, along.majorant)
        return second, along.until(rate, along.majorant * real / (real + null))

    return expected


def residual_ratio(along: AlongRays) -> Expected:
    """With a control."""
    residual = along.sigma - along.control
    second = along.transmittance**2 * np.exp(along.integral(residual**2 / along.majorant))
    return second, along.integral(0 * along.sigma + along.majorant)


def weighted_decomposition(along: AlongRays) -> Expected:
    """With weights of either sign."""
    residual = along.sigma - along.control
    null = np.abs(along.majorant - residual)
    both = np.abs(residual) + null
    second = np.exp(along.integral(null * both / along.majorant - along.majorant - along.control))
    rate = np.full_like(along.sigma, along.majorant)
    ends = along.control + along.majorant * np.abs(residual) / both
    return second, along.until(rate, ends)


def track_length_cost(along: AlongRays) -> Expected:
    """Two lookups a segment but the last; its variance has no formula."""
    rate = np.full_like(along.sigma, along.majorant)
    return None, 2.0 * along.until(rate, along.sigma) + along.transmittance


def cost_of(known: Callable[[AlongRays], Expected]) -> Callable[[AlongRays], Expected]:
    """Lookups as those of another; no formula of the variance."""
    return lambda along: (None, known(along)[1])
