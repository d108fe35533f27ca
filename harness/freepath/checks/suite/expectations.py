"""Second moments and lookups of the estimators, as docs/estimators.md derives them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from freepath.checks.rig import Flight
from freepath.scene import majorants
from freepath.scene.media.base import crossings, partition

Array = NDArray[np.float64]
Expected = tuple[Array | None, Array]
"""The mean of the squared score, where it has a formula, and of the lookups: of each ray."""

POINTS = 2048
"""Of the midpoint rule along a ray: its error is far below that of the samples."""


class AlongRays:
    """sigma_t at midpoints of equal intervals of each ray, with the majorant and control there."""

    def __init__(self, flight: Flight):
        self.flight, segments = flight, flight.segments
        self.step = segments[:, 6:] / POINTS
        t = (np.arange(POINTS) + 0.5) * self.step
        points = segments[:, None, :3] + t[..., None] * segments[:, None, 3:6]
        self.sigma = flight.medium.sigma_t(points.reshape(-1, 3)).reshape(t.shape)
        case = flight.case
        control = case.params if "control" in flight.tracker.needs else None
        self._model, self._cells = case.majorant, np.array((1, 1, 1))
        if case.majorant is None:
            return
        self._cells = np.array(majorants.cells_of(case.majorant))
        bounds = flight.medium.bounds(tuple(self._cells))
        self._made = majorants.build(case.majorant, flight.medium, bounds, case.tightness, control)
        cell = self._cell(points)
        self.majorant = self._value(0, cell) + np.zeros_like(t)
        last = 2 if case.majorant.kind == "octree" else 1
        self.control = self._value(last, cell) if control else 0.0

    def _cell(self, points: Array) -> NDArray[np.intp]:
        where = points / self.flight.medium.extent * self._cells
        return np.clip(where.astype(np.intp), 0, self._cells - 1)

    def _value(self, layer: int, cell: NDArray[np.intp]) -> Array | float:
        """What `majorants.build` laid into an array, or its number where there is none."""
        data = self._made.data
        if data is None:
            return list(self._made.numbers.values())[layer]
        i, j, k = np.moveaxis(cell + (self._model.kind == "grid"), -1, 0)
        return data[layer][k, j, i].astype(np.float64)

    def crossed(self, ends: Array | float = 0.0) -> Array:
        """How many planes between cells, or leaves, a path meets that a rate ends on its way.

        Cells that meet in an edge or corner of which the ray passes are entered at once.
        """
        segments = self.flight.segments
        planes = [
            np.arange(1, n) / n * e
            for n, e in zip(self._cells, self.flight.medium.extent, strict=True)
        ]
        cuts = [
            crossings(segments[:, axis], segments[:, 3 + axis], planes[axis], segments[:, 6])
            for axis in range(3)
        ]
        start, length = partition(np.concatenate(cuts, axis=1), segments[:, 6])
        middle = start + length / 2.0
        cell = self._cell(segments[:, None, :3] + middle[..., None] * segments[:, None, 3:6])
        if self._model.kind == "octree":
            cell &= -self._value(1, cell).astype(np.intp)[..., None]
        # a piece of no length is of the cell before or after
        other = (np.diff(cell, axis=1) != 0).any(axis=2) & (start[:, 1:] < segments[:, 6:])
        place = np.minimum(start[:, 1:] / self.step, POINTS - 1).astype(np.intp)
        alive = np.take_along_axis(self.alive(ends), place, axis=1)
        return (other * alive).sum(axis=1)

    def alive(self, ends: Array | float) -> Array:
        """The share of paths that a rate has not ended, at each point."""
        ended = (ends + np.zeros_like(self.sigma)) * self.step
        return np.exp(0.5 * ended - np.cumsum(ended, axis=1))

    def integral(self, values: Array) -> Array:
        """Of values at the midpoints."""
        return (values * self.step).sum(axis=1)

    def until(self, rate: Array, end_rate: Array) -> Array:
        """The integral of a rate over the paths that an end rate has not ended."""
        return self.integral(rate * self.alive(end_rate))

    @property
    def transmittance(self) -> Array:
        """Of each ray."""
        return np.exp(-self.integral(self.sigma))


def share(of: Array, whole: Array) -> Array:
    """Their quotient, 0 where there is nothing of either."""
    return np.divide(of, whole, out=np.zeros_like(of), where=whole > 0.0)


def binary(along: AlongRays) -> Expected:
    """Delta tracking, of the residual where there is a control: 0 or 1."""
    return along.transmittance, along.until(along.majorant, along.sigma)


def ratio(along: AlongRays) -> Expected:
    """Ratio tracking."""
    square = along.integral(share(along.sigma**2, along.majorant))
    return along.transmittance**2 * np.exp(square), along.integral(along.majorant)


def free(acceptance: float, albedo: float = 1.0) -> Callable[[AlongRays], Expected]:
    """two_knob: real collisions with odds acceptance * sigma / |sigma_n|."""

    def expected(along: AlongRays) -> Expected:
        null = np.abs(along.majorant - along.sigma)
        real = acceptance * albedo * along.sigma
        second = np.exp(along.integral(null * (real + null) / along.majorant - along.majorant))
        return second, along.until(along.majorant, along.majorant * real / (real + null))

    return expected


def residual_ratio(along: AlongRays) -> Expected:
    """With a control."""
    residual = along.sigma - along.control
    second = along.transmittance**2 * np.exp(along.integral(residual**2 / along.majorant))
    return second, along.integral(along.majorant)


def weighted_decomposition(along: AlongRays) -> Expected:
    """With weights of either sign."""
    residual = along.sigma - along.control
    null = np.abs(along.majorant - residual)
    both = np.abs(residual) + null
    second = np.exp(along.integral(null * both / along.majorant - along.majorant - along.control))
    ends = along.control + along.majorant * np.abs(residual) / both
    return second, along.until(along.majorant, ends)


def track_length_cost(along: AlongRays) -> Expected:
    """Two lookups a segment but the last; its variance has no formula."""
    return None, 2.0 * along.until(along.majorant, along.sigma) + along.transmittance


def cost_of(known: Callable[[AlongRays], Expected]) -> Callable[[AlongRays], Expected]:
    """Lookups as those of another; no formula of the variance."""
    return lambda along: (None, known(along)[1])
