"""Second moments and lookups of the estimators, as docs/estimators.md derives them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freepath.checks.rig import Flight
from freepath.scene import majorants
from freepath.scene.media.base import crossings, partition

Array = NDArray[np.float64]
Expected = tuple[Array | None, Array] | tuple[Array | None, Array, Array]
"""The mean of the squared score, where it has a formula, and of the lookups: of each ray. Of a
biased estimator, the mean of its score too."""

POINTS = 2048
"""Of the midpoint rule along a ray: its error is far below that of the samples."""
OFFSETS = 256
"""Of a comb of steps, that are averaged over."""


class AlongRays:
    """sigma_t at midpoints of equal intervals of each ray, with the majorant and control there."""

    def __init__(self, flight: Flight):
        self.flight, segments = flight, flight.segments
        self.step = segments[:, 6:] / POINTS
        t = (np.arange(POINTS) + 0.5) * self.step
        points = self.points(t)
        self.sigma = flight.medium.sigma_t(points.reshape(-1, 3)).reshape(t.shape)
        case = flight.case
        self.params = case.params
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

    def points(self, t: Array) -> Array:
        """The places at distances t (rays, samples)."""
        segments = self.flight.segments
        return segments[:, None, :3] + t[..., None] * segments[:, None, 3:6]

    def majorant_at(self, points: Array) -> Array | float:
        """The majorant of the cells that they are in."""
        return self._value(0, self._cell(points))

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


def jackknife(along: AlongRays) -> Expected:
    """Two marches: products over their intervals, each of a mean."""
    steps = int(along.params["steps"])
    pieces = along.sigma * along.step * (POINTS // steps)
    pieces = pieces.reshape(len(pieces), steps, -1)

    def march(k: complex) -> Any:
        return np.exp(-k * pieces).mean(axis=2).prod(axis=1)

    second = (march(1.0) ** 2 + np.abs(march(1.0 + 1.0j)) ** 2) / 2.0
    lookups = np.full(len(pieces), 2.0 * steps)
    return second, lookups, np.abs(march(0.5 + 0.5j)) ** 2


def jackknife_placed(along: AlongRays) -> Expected:
    """The same of intervals that are equal in the depth of the density of lookups."""
    steps, density, control = int(along.params["steps"]), along.majorant, along.control
    depth = np.insert(np.cumsum(density * along.step, axis=1), 0, 0.0, axis=1)
    share = depth[:, -1:] / steps
    counted = (along.sigma - control) / np.where(density > 0.0, density, 1.0) * share

    def march(k: complex) -> Any:
        inside = np.cumsum(np.exp(-k * counted) * density * along.step, axis=1)
        inside = np.insert(inside, 0, 0.0, axis=1)
        means = [
            np.diff(np.interp(np.arange(steps + 1) * s, d, ins)) / s if s > 0.0 else np.ones(steps)
            for s, d, ins in zip(share[:, 0], depth, inside, strict=True)
        ]
        return np.prod(means, axis=1) * np.exp(-k * along.integral(control))

    second = (march(1.0) ** 2 + np.abs(march(1.0 + 1.0j)) ** 2) / 2.0
    return second, np.full(len(depth), 2.0 * steps), np.abs(march(0.5 + 0.5j)) ** 2


def biased_march(along: AlongRays) -> Expected:
    """One comb of equal steps, at many offsets; `matched` has a lookup at both ends too."""
    medium, segments, length = (
        along.flight.medium,
        along.flight.segments,
        along.flight.segments[:, 6],
    )
    whole = along.majorant[:, 0] * length
    teeth = np.ceil(np.cbrt((0.015 + whole) * (0.65 + whole) * (60.3 + whole)))
    matched = along.params["ends"] == "matched"
    start, way = segments[:, :3], length[:, None] * segments[:, 3:6]
    rise = medium.sigma_t(start + way) - medium.sigma_t(start)
    tooth = np.arange(teeth.max())
    scores = []
    for offset in (np.arange(OFFSETS) + 0.5) / OFFSETS:
        t = (np.minimum(tooth, teeth[:, None] - 1.0) + offset) * (length / teeth)[:, None]
        points = segments[:, None, :3] + t[..., None] * segments[:, None, 3:6]
        sigma = medium.sigma_t(points.reshape(-1, 3)).reshape(t.shape) * (tooth < teeth[:, None])
        tilt = matched * (offset - 0.5) * rise
        scores.append(np.exp((tilt - sigma.sum(axis=1)) * length / teeth))
    return np.square(scores).mean(axis=0), teeth + 2.0 * matched, np.mean(scores, axis=0)


def production_march(along: AlongRays) -> Expected:
    """Steps at one offset, of which many are tried; what a cell of majorant 0 has is left out."""
    step, stop = along.params["step"], along.params["stop"]
    segments, medium = along.flight.segments, along.flight.medium
    start = step * np.arange(np.ceil(segments[:, 6].max() / step))
    width = np.clip(segments[:, 6:] - start, 0.0, step)
    scores, lookups = [], []
    for offset in (np.arange(OFFSETS) + 0.5) / OFFSETS:
        points = along.points(start + offset * width)
        some = (along.majorant_at(points) > 0.0) & (width > 0.0)
        sigma = np.where(some, medium.sigma_t(points.reshape(-1, 3)).reshape(some.shape), 0.0)
        depth = np.cumsum(sigma * width, axis=1)
        bright = depth <= -np.log(stop)
        scores.append(np.where(bright[:, -1], np.exp(-depth[:, -1]), 0.0))
        # the step that makes it dark is looked up
        lookups.append((some & np.insert(bright, 0, True, axis=1)[:, :-1]).sum(axis=1))
    return np.square(scores).mean(axis=0), np.mean(lookups, axis=0), np.mean(scores, axis=0)


def resampled(along: AlongRays) -> Expected:
    """Ratio tracking, which a flight with a candidate leaves by 1 - scatter."""
    second, lookups = ratio(along)[:2]
    none = np.exp(-along.integral(along.majorant * (along.sigma > 0.0)))
    return (second - none) / (1.0 - along.params["scatter"]) + none, lookups


def collision(along: AlongRays) -> Expected:
    """Each collision with itself, and with all that are still to come."""
    share, left = along.sigma / along.majorant, along.sigma * along.step
    reached = np.exp(-(np.cumsum(left, axis=1) - 0.5 * left))
    still = 1.0 - along.transmittance[:, None] / reached
    square = along.integral(along.sigma * reached * (share + 2.0 * (1.0 - share) * still))
    return square - 1.0 + 2.0 * along.transmittance, binary(along)[1]


def factored(along: AlongRays) -> Expected:
    """Delta tracking of the residual, times what the control lets through."""
    residual = along.sigma - along.control
    through = np.exp(-along.integral(0.0 * residual + along.control))
    lookups = along.until(0.0 * residual + along.majorant, residual)
    return along.transmittance * through, lookups


def hybrid(along: AlongRays) -> Expected:
    """Backwards through constant cells: of flights (f) and of walks (w), from a cell's start on."""
    medium, segments, majorant = along.flight.medium, along.flight.segments, along.majorant[:, 0]
    pieces = medium.pieces(segments)
    f, w, f_lookups, w_lookups = (np.full(len(segments), value) for value in (1.0, 1.0, 0.0, 0.0))
    for start, span in zip(pieces.start.T[::-1], pieces.length.T[::-1], strict=True):
        there = segments[:, :3] + (start + 0.5 * span)[:, None] * segments[:, 3:6]
        sigma, some = medium.sigma_t(there), span > 0.0
        thin = sigma < along.params["threshold"] * majorant
        hit, lost = -np.expm1(-majorant * span), -np.expm1(-sigma * span)
        null, rate = 1.0 - sigma / majorant, majorant - 2.0 * sigma
        walked = np.exp(-2.0 * sigma * span) * w
        begun = (majorant - sigma) * walked * -np.expm1(-rate * span) / rate
        f = np.where(some, np.where(thin, (1.0 - hit) * f + begun, (1.0 - lost) * f), f)
        w = np.where(some, np.where(thin, walked, f), w)
        thick = (1.0 - lost) * f_lookups + majorant * lost / np.where(thin, 1.0, sigma)
        begun = (1.0 - hit) * f_lookups + hit * (1.0 + null * (1.0 + w_lookups))
        f_lookups = np.where(some, np.where(thin, begun, thick), f_lookups)
        w_lookups = np.where(some, 1.0 + np.where(thin, w_lookups, f_lookups), w_lookups)
    return f, f_lookups
