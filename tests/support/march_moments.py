"""The moments of the two debiased marches of docs/estimators.md, in float64.

Each is a class with what `derivations` gives of the other trackers: moments, and lookups. Arrays
are over rays first. Where a march looks up is continuous, so expectations over it are quadratures:
Gauss-Legendre of `NODES` points in pieces of each interval, `PIECES` of the whole ray at least.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import comb, factorial

import numpy as np
from numpy.typing import NDArray

from support.derivations import AlongRays, extinction

Array = NDArray[np.float64]

NODES, PIECES = 4, 512
LEVELS_TO = 400  # intervals: beyond, sums of their squares would lose their digits


def gauss(pieces: int) -> tuple[Array, Array]:
    """Places in (0, 1) and their weights, which add up to 1: a rule in each of equal pieces."""
    node, weight = np.polynomial.legendre.leggauss(NODES)
    place = (np.arange(pieces)[:, None] + 0.5 * (node + 1.0)) / pieces
    return place.ravel(), np.tile(0.5 * weight / pieces, pieces)


def depths(along: AlongRays, intervals: int) -> tuple[Array, Array]:
    """Lookup x length of an interval (rays, intervals, places in each), and weights of places."""
    places, weights = gauss(-(-PIECES // intervals))
    fractions = (np.arange(intervals)[:, None] + places) / intervals
    sigma = extinction(along.flight.medium, along.flight.segments, fractions.ravel())
    length = along.flight.segments[:, 6:, None] / intervals
    return sigma.reshape(-1, *fractions.shape) * length, weights


class Telescoping:
    """A jittered march, and one antithetic difference of a random level over its chance."""

    def __init__(self, along: AlongRays):
        self.along = along
        self.steps = int(along.flight.case.params["steps"])
        self.ratio = float(along.flight.case.params["ratio"])

    def march(self, power: int) -> Array:
        """A moment of the coarsest march: intervals are independent, so it is a product."""
        depth, weights = depths(self.along, self.steps)
        return np.prod(np.exp(-power * depth) @ weights, axis=1)

    def difference(self, level: int, places: tuple[Array, Array] | None = None) -> Array:
        """The second moment of the difference of a level, before it is divided by its chance.

        With a pair's sum s and difference d it is the mean of exp(-2 s) (cosh of the signed sum of
        all d, less 1)^2. `spread` is the log of the mean of cosh(k d) over that of 1, in the
        measure exp(-2 s), of all pairs. All depths are taken from their pair's mean, so that small
        numbers come from small numbers.
        """
        depth, weights = places or depths(self.along, self.steps * 2 ** (level + 1))
        pairs = depth.reshape(len(depth), -1, 2, depth.shape[2])
        middle = (pairs @ weights).mean(axis=2)
        around = pairs - middle[..., None, None]

        def less_one(power: int) -> Array:
            return np.expm1(-power * around) @ weights

        def both(power: int, other: int) -> Array:
            one, two = less_one(power), less_one(other)
            return 0.5 * (
                one[..., 0]
                + two[..., 1]
                + one[..., 0] * two[..., 1]
                + two[..., 0]
                + one[..., 1]
                + two[..., 0] * one[..., 1]
            )

        equal = both(2, 2)

        def spread(k: int) -> Array:
            return np.log1p((both(2 + k, 2 - k) - equal) / (1.0 + equal)).sum(axis=1)

        whole = np.exp((np.log1p(equal) - 4.0 * middle).sum(axis=1))
        return whole * (0.5 * np.expm1(spread(2)) - 2.0 * np.expm1(spread(1)))

    def moment(self, power: int) -> Array:
        """The first or second."""
        exact = self.along.transmittance
        if power == 1:
            return exact
        mean = self.march(1)
        squares, level = [], 0
        while self.steps * 2 ** (level + 1) <= LEVELS_TO:
            chance = (1.0 - self.ratio) * self.ratio**level
            squares.append(self.difference(level) / chance)
            level += 1
        # further levels fall as the last two did
        falls = np.divide(squares[-1], squares[-2], out=np.zeros_like(mean), where=squares[-2] > 0)
        further = squares[-1] * falls / (1.0 - np.minimum(falls, 0.9))
        return self.march(2) + 2.0 * mean * (exact - mean) + sum(squares) + further

    def lookups(self) -> Array:
        """Those of the coarsest march, and twice as many times 2^level of the other."""
        each = self.steps * (1.0 + 2.0 * (1.0 - self.ratio) / (1.0 - 2.0 * self.ratio))
        return np.full(len(self.along.sigma), each)


MOST = 15  # orders: the tracker's roulette has no more
AT_LEAST = [1.0, 0.9, *(0.9 * 2.0 ** (k - 1) / factorial(k) for k in range(2, MOST + 1)), 0.0]
COEFFICIENTS = [1.0 / (factorial(k) * AT_LEAST[k]) for k in range(MOST + 1)]


def common(number: int, k: int, other: int, shared: int) -> float:
    """How often subsets of k and `other` of a number of things have `shared` chosen in common."""
    return comb(k, shared) * comb(other, shared) / comb(number, shared)


Mean = Callable[[int], Array]


def square_of_order(order: int, variance: Array, once: Mean, twice: Mean) -> Array:
    """The second moment of the power series of an order, from moments of single combs.

    X is the optical depth of a comb and a its deviation from the mean. `once(p)` is the mean of
    exp(-X) a^p, `twice(p)` that of exp(-2 X) a^p, `variance` that of X. See docs/estimators.md.
    """
    weights = COEFFICIENTS[: order + 1]
    same = sum(
        weights[k] * weights[m] * common(order, k, m, s) * variance**s * twice(k + m - 2 * s)
        for k in range(order + 1)
        for m in range(order + 1)
        for s in range(min(k, m) + 1)
    )
    if order == 0:
        return same
    # two pivots: what the other one contributes to each is taken out of the products
    plain = [weights[k] * (1.0 - k / order) for k in range(order)]
    joined = [weights[k + 1] * (k + 1) / order for k in range(order)]
    different = 0.0
    for k in range(order):
        for m in range(order):
            for s in range(min(k, m) + 1):
                p, q = k - s, m - s
                term = plain[k] * plain[m] * once(p) * once(q)
                crossed = joined[k] * plain[m] - plain[k] * joined[m]
                term = term + crossed * (once(p + 1) * once(q) - once(p) * once(q + 1))
                apart = once(p + 2) * once(q) - 2.0 * once(p + 1) * once(q + 1)
                term = term - joined[k] * joined[m] * (apart + once(p) * once(q + 2))
                different = different + common(order - 1, k, m, s) * variance**s * term
    return (same + order * different) / (order + 1)


class UnbiasedMarch:
    """Combs of equal steps at random offsets in a power series of random order."""

    def __init__(self, along: AlongRays):
        self.along = along
        majorant = along.integral(along.majorant)
        parts = (0.015 + majorant) * (0.65 + majorant) * (60.3 + majorant)
        self.teeth = np.ceil(np.cbrt(parts)).astype(int)

    @cached_property
    def combs(self) -> tuple[Array, Array]:
        """The optical depth of a comb (rays, offsets), and the weights of the offsets."""
        pieces = -(-PIECES // self.teeth.min())
        offsets, weights = gauss(pieces)
        found = np.empty((len(self.teeth), len(offsets)))
        flight = self.along.flight
        for teeth in np.unique(self.teeth):
            rays = np.flatnonzero(self.teeth == teeth)
            fractions = (np.arange(teeth)[:, None] + offsets) / teeth
            sigma = extinction(flight.medium, flight.segments[rays], fractions.ravel())
            mean = sigma.reshape(len(rays), teeth, -1).mean(axis=1)
            found[rays] = mean * flight.segments[rays, 6:]
        return found, weights

    def moment(self, power: int) -> Array:
        """The first or second, from the same combs: the variance is a small difference of both."""
        depth, weights = self.combs
        mean = depth @ weights
        if power == 1:
            return np.exp(-mean)
        away = depth - mean[:, None]
        once = [(np.exp(-depth) * away**p) @ weights for p in range(MOST + 2)]
        twice = [(np.exp(-2.0 * depth) * away**p) @ weights for p in range(2 * MOST + 1)]
        variance = away**2 @ weights
        return sum(
            (AT_LEAST[order] - AT_LEAST[order + 1])
            * self.square(order, variance, once.__getitem__, twice.__getitem__)
            for order in range(MOST + 1)
        )

    def square(self, order: int, variance: Array, once: Mean, twice: Mean) -> Array:
        """The second moment of the power series of an order."""
        return square_of_order(order, variance, once, twice)

    def lookups(self) -> Array:
        """One a tooth of each comb, of which there is one more than the order."""
        return self.teeth * sum(AT_LEAST)
