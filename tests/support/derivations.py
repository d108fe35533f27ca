"""What docs/estimators.md derives of the trackers, in float64: moments of estimates, and lookups.

Everything is an array over rays, or (rays, points) at midpoints of equal intervals of each ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from freepath.checks.rig import Flight
from freepath.scene import Medium, majorants

Array = NDArray[np.float64]

POINTS = 2048  # the error of the midpoint rule is far below that of the samples


class AlongRays:
    """The extinction at the points; majorant and control of the whole medium, 0 without."""

    def __init__(self, flight: Flight, sigma: Array | None = None):
        self.flight = flight
        self.step = flight.segments[:, 6:] / POINTS
        self.sigma = extinction(flight.medium, flight.segments) if sigma is None else sigma
        case = flight.case
        control = case.params if "control" in flight.tracker.needs else None
        numbers = {"sigma_t": 0.0}
        if case.majorant is not None:
            bounds = flight.medium.bounds((1, 1, 1))
            built = majorants.build(case.majorant, flight.medium, bounds, case.tightness, control)
            numbers = built.numbers
        self.majorant = numbers.get("sigma_t", numbers.get("residual"))
        self.control = numbers.get("control", 0.0)
        self.residual = self.sigma - self.control

    def integral(self, values: Array) -> Array:
        return (np.broadcast_to(values, self.sigma.shape) * self.step).sum(axis=1)

    def up_to(self, values: Array) -> Array:
        """The integral from the start of each ray to each point."""
        pieces = np.broadcast_to(values, self.sigma.shape) * self.step
        return np.cumsum(pieces, axis=1) - 0.5 * pieces

    def ahead(self, rate: Array, values: Array) -> Array:
        """The integral from each point on, what lies ahead attenuated at a rate up to there."""
        attenuation = np.exp(-self.up_to(rate))
        pieces = attenuation * values * self.step
        return (np.cumsum(pieces[:, ::-1], axis=1)[:, ::-1] - 0.5 * pieces) / attenuation

    @cached_property
    def depth(self) -> Array:
        return self.integral(self.sigma)

    @property
    def transmittance(self) -> Array:
        return np.exp(-self.depth)


def extinction(medium: Medium, segments: Array, fractions: Array | None = None) -> Array:
    """The extinction (1/world length) at the points of each ray, or at fractions of its length."""
    if fractions is None:
        fractions = (np.arange(POINTS) + 0.5) / POINTS
    t = fractions * segments[:, 6:]
    points = segments[:, None, :3] + t[..., None] * segments[:, None, 3:6]
    return medium.sigma_t(points.reshape(-1, 3)).reshape(t.shape)


@dataclass(frozen=True)
class Chain:
    """Tentative collisions at the rate `majorant`, each survived with a chance and a factor.

    `ends` is the rate of further collisions, which take no lookup; `fades` what the weight is
    attenuated by along the ray.
    """

    along: AlongRays
    survival: Array
    factor: Array
    ends: float = 0.0
    fades: float = 0.0

    def _rate(self, power: int) -> Array:
        lost = self.along.majorant * (1.0 - self.survival * self.factor**power)
        return lost + self.ends + power * self.fades

    def moment(self, power: int) -> Array:
        """The expectation of a power of the estimate."""
        return np.exp(-self.along.integral(self._rate(power)))

    def lookups(self) -> Array:
        """The expected number: collisions of paths that are still alive."""
        alive = np.exp(-self.along.up_to(self._rate(0)))
        return self.along.integral(self.along.majorant * alive)


def delta(along: AlongRays) -> Chain:
    """Also decomposition, whose control is 0 in delta."""
    survival = np.maximum(1.0 - along.residual / along.majorant, 0.0)
    return Chain(along, survival, np.ones_like(survival), ends=along.control)


def ratio(along: AlongRays) -> Chain:
    """Also residual ratio, whose control is 0 in ratio."""
    factor = 1.0 - along.residual / along.majorant
    return Chain(along, np.ones_like(factor), factor, fades=along.control)


def two_knob(acceptance: float):
    """Real collisions with the odds acceptance x sigma : |sigma_n|; or with residuals."""

    def chain(along: AlongRays) -> Chain:
        null = along.majorant - along.residual
        both = acceptance * np.abs(along.residual) + np.abs(null)
        factor = np.sign(null) * both / along.majorant
        return Chain(along, np.abs(null) / both, factor, ends=along.control)

    return chain


@dataclass(frozen=True)
class NextFlight:
    """The chance of flying out is scored at the start and after every null collision of a chain."""

    chain: Chain

    def moment(self, power: int) -> Array:
        """The first or second."""
        along, chain = self.chain.along, self.chain
        if power == 1:
            return chain.moment(1)
        whole = along.majorant * along.sigma.shape[1] * along.step[:, 0]
        ahead = np.exp(along.up_to(along.majorant) - whole[:, None])
        mean = chain.moment(1)
        mean_ahead = mean[:, None] * np.exp(along.up_to(chain._rate(1)))
        square = np.exp(-along.up_to(chain._rate(2)))
        kept = along.majorant * chain.survival * chain.factor**2 * square
        later = along.integral(kept * ahead * (2.0 * mean_ahead - ahead))
        return np.exp(-whole) * (2.0 * mean - np.exp(-whole)) + later

    def lookups(self) -> Array:
        return self.chain.lookups()


@dataclass(frozen=True)
class TrackLength:
    """A delta track, whose segments' optical depth is estimated by one lookup each."""

    chain: Chain

    def moment(self, power: int) -> Array:
        """The first or second."""
        along, chain = self.chain.along, self.chain
        alive = np.exp(-along.up_to(chain._rate(1)))
        lost = along.integral(along.sigma * alive)
        if power == 1:
            return 1.0 - lost
        return 1.0 - 2.0 * lost + along.integral(alive * (self.alone() + self.paired()))

    def alone(self) -> Array:
        """Squares of single segments."""
        along = self.chain.along
        majorant, sigma = along.majorant, along.sigma
        return sigma**2 * along.ahead(majorant, 1.0) + along.ahead(majorant, sigma**2)

    def paired(self) -> Array:
        """Twice a segment's estimate times those of all later ones."""
        along, chain = self.chain.along, self.chain
        later = along.majorant * chain.survival * along.ahead(chain._rate(1), along.sigma)
        return 2.0 * along.sigma * along.ahead(along.majorant, later)

    def lookups(self) -> Array:
        return 2.0 * self.chain.lookups() + self.chain.moment(0)


@dataclass(frozen=True)
class Series:
    """The p-series: terms to the `mass` of a Poisson distribution, then Russian roulette."""

    along: AlongRays
    mass: float = 0.99

    def _terms(self) -> tuple[Array, Array]:
        """Poisson probabilities, and the chances that the terms are evaluated, (rays, terms)."""
        mean = self.along.majorant * self.along.sigma.shape[1] * self.along.step
        orders = np.arange(int(mean.max() + 12.0 * np.sqrt(mean.max()) + 40.0))
        before = stats.poisson.cdf(orders - 1, mean)
        goes_on = np.where(before >= self.mass, np.minimum(mean / np.maximum(orders, 1), 1.0), 1.0)
        return stats.poisson.pmf(orders, mean), np.cumprod(goes_on, axis=1)

    def moment(self, power: int) -> Array:
        """The first or second."""
        along = self.along
        if power == 1:
            return along.transmittance
        share, chance = self._terms()
        null = 1.0 - along.sigma / along.majorant
        mean, square = null.mean(axis=1), (null**2).mean(axis=1)
        # sum over j <= k of what the terms j and k have in common, from the last k on
        taken = np.divide(share, chance, out=np.zeros_like(share), where=chance > 0.0)
        tail, total = np.zeros_like(mean), np.zeros_like(mean)
        for j in range(share.shape[1] - 1, -1, -1):
            total += taken[:, j] * square**j * (share[:, j] + 2.0 * mean * tail)
            tail = share[:, j] + mean * tail
        return total

    def lookups(self) -> Array:
        return self._terms()[1][:, 1:].sum(axis=1)
