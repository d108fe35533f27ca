"""Variance and lookups of what samples a light, and of its shadow rays, against integrals."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from scipy import stats

from freepath.checks.identities import check_count, check_mean, check_variance
from freepath.checks.rig import Flight, Rig
from freepath.checks.suite.common import Checks, unit
from freepath.checks.suite.expectations import Array
from freepath.checks.suite.scattering import homogeneous
from freepath.checks.verdict import require
from freepath.scene.lights.radiance import henyey_greenstein

SIGMA, ALBEDO, TIGHTNESS, INTENSITY = 2.0, 0.5, 1.5, 10.0
MAJORANT = SIGMA * TIGHTNESS
POINTS = 4096
"""Of the midpoint rule along a ray; bins of a table end between them."""
_STARTS = np.stack(np.meshgrid([0.1, 0.3, 0.5, 0.7], [0.15, 0.35, 0.55, 0.75], [0.1]), axis=-1)
ASLANT = _STARTS.reshape(-1, 3), unit(np.tile([0.3, 0.2, 1.0], (16, 1)))
"""Rays that start inside."""
PLACES = {"outside": [0.3, 0.4, 1.3], "inside": [0.55, 0.6, 0.4]}
SAMPLERS: dict[str, dict[str, Any]] = {
    "delta": {"delta": {}},
    "equiangular": {"equiangular": {}},
    "tabulated": {"tabulated": {"table": "transmittance", "bins": 4, "even": 0.3}},
    "tabulated-product": {"tabulated": {"table": "product", "bins": 16}},
    "combined": {"combined": {"share": 0.3}},
    "joint": {"joint": {"cells": 5}},
}
checks = Checks()


class Integrals:
    """Second moments and lookups of light that scatters once in a homogeneous cube, of each ray."""

    def __init__(self, flight: Flight, position: list[float], g: float):
        segments = flight.segments
        self.length, self.params = segments[:, 6:], flight.case.params
        self.t = (np.arange(POINTS) + 0.5) / POINTS * self.length
        ahead = segments[:, None, 3:6]
        points = segments[:, None, :3] + self.t[..., None] * ahead
        gap = np.array(position) - points
        distance = np.linalg.norm(gap, axis=2)
        towards = gap / distance[..., None]
        self.cosine = (towards * ahead).sum(axis=2)
        to_faces = (np.where(towards > 0.0, 1.0, 0.0) - points) / towards
        way = np.minimum(to_faces.min(axis=2), distance)
        first = np.array(position) - segments[:, :3]
        self.nearest = (first * ahead[:, 0]).sum(axis=1)[:, None]
        square = (first**2).sum(axis=1)[:, None] - self.nearest**2
        self.off, self.g = np.sqrt(square), g
        self.angle = np.arctan((self.length - self.nearest) / self.off)
        self.angle += np.arctan(self.nearest / self.off)
        self.light = ALBEDO * INTENSITY * SIGMA * henyey_greenstein(g, self.cosine) / distance**2
        self.seen, self.shadow = _squared(way), MAJORANT * way

    def along(self, values: Array) -> Array:
        """The integral over each ray."""
        return values.mean(axis=1) * self.length[:, 0]

    def _equiangular(self) -> Array:
        return self.off / (self.angle * (self.off**2 + (self.t - self.nearest) ** 2))

    def _tabulated(self) -> Array:
        """Constant in each bin, of which a share is the same everywhere."""
        bins = int(self.params["bins"])
        middle = (np.arange(bins) + 0.5) / bins * self.length
        value = SIGMA * np.exp(-SIGMA * middle)
        if self.params["table"] == "product":
            value /= self.off**2 + (middle - self.nearest) ** 2
        value += float(self.params["even"]) * value.mean(axis=1, keepdims=True)
        return np.repeat(value / value.mean(axis=1, keepdims=True), POINTS // bins, axis=1) / (
            self.length
        )

    def _joint(self) -> Array:
        """By the phase function, linear in the angle between the ends of its cells."""
        cells = int(self.params["cells"])
        ends = np.arctan2(self.off, self.nearest) + self.angle * np.arange(cells + 1) / cells
        phase = henyey_greenstein(self.g, np.cos(ends))
        place = (np.arctan2(self.off, self.nearest - self.t) - ends[:, :1]) / self.angle * cells
        cell = np.clip(place.astype(int), 0, cells - 1)
        low, high = (np.take_along_axis(phase, cell + i, axis=1) for i in (0, 1))
        mean = ((phase[:, 1:] + phase[:, :-1]) / 2.0).mean(axis=1, keepdims=True)
        return self._equiangular() * (low + (high - low) * (place - cell)) / mean

    def aimed(self, density: Array, share: Array | float = 1.0) -> tuple[Array, Array]:
        """Of ratio tracking to a distance of that density, and a lookup there."""
        squared = self.along((share * self.light) ** 2 / density * _squared(self.t) * self.seen)
        return squared, self.along(density * (MAJORANT * self.t + 1.0 + self.shadow))

    def played(self, share: Array | float = 1.0) -> tuple[Array, Array]:
        """Of delta tracking."""
        density = SIGMA * np.exp(-SIGMA * self.t)
        squared = self.along(density * (share * self.light / SIGMA) ** 2 * self.seen)
        lookups = MAJORANT / SIGMA * -np.expm1(-SIGMA * self.length[:, 0])
        return squared, lookups + self.along(density * self.shadow)

    def density(self, tracker: str) -> Array:
        """Of the distances at which flights end inside."""
        by_extinction = SIGMA * np.exp(-SIGMA * self.t)
        if tracker == "delta":
            return by_extinction
        if tracker == "combined":
            chance = float(self.params["share"])
            return chance * self._equiangular() + (1.0 - chance) * by_extinction
        return getattr(self, f"_{tracker}")()

    def shares(self, tracker: str, t: Array) -> Array:
        """The chance to end before distances t (rays, samples), given that a flight does inside."""
        density = self.density(tracker)
        below = np.pad(np.cumsum(density, axis=1), ((0, 0), (1, 0))) / density.sum(
            axis=1, keepdims=True
        )
        place = np.clip(t / self.length * POINTS, 0.0, POINTS - 1e-6)
        cell = place.astype(int)
        low, high = (np.take_along_axis(below, cell + i, axis=1) for i in (0, 1))
        return low + (high - low) * (place - cell)

    def of(self, tracker: str) -> tuple[Array, Array]:
        """The second moment of a sample, and its lookups."""
        if tracker == "delta":
            return self.played()
        if tracker == "combined":
            density, chance = self._equiangular(), float(self.params["share"])
            other = (1.0 - chance) * SIGMA * np.exp(-SIGMA * self.t)
            share = chance * density / (chance * density + other)
            one, two = self.aimed(density, share), self.played(1.0 - share)
            rest = 1.0 - chance
            return one[0] / chance + two[0] / rest, 4.0 + chance * one[1] + rest * two[1]
        squared, lookups = self.aimed(self.density(tracker))
        return squared, lookups + (self.params["bins"] if tracker == "tabulated" else 0.0)


def _squared(way: Array) -> Array:
    """The second moment of ratio tracking."""
    return np.exp((SIGMA / MAJORANT - 2.0) * SIGMA * way)


def moments(rig: Rig, alpha: float, tracker: str, sampler: Any, place: str) -> None:
    """Samplers of light stay unbiased with any density that they divide by, and shadow rays with
    any weight: what a slip costs is variance and lookups, which have integrals."""
    # Distances, variance and lookups of single scattering.
    g, position = (0.6, -0.4)[place == "inside"], PLACES[place]
    flight = rig.flight(
        tracker=sampler,
        medium=homogeneous(SIGMA, albedo=ALBEDO, g=g),
        light={"point": {"position": position, "intensity": INTENSITY}},
        lines=ASLANT,
        **{"estimand": "radiance", "scatterings": 1, "shadow": "ratio", "tightness": TIGHTNESS},
        lanes=16,
    )
    samples, expected = flight.record(16384), flight.reference()
    integrals = Integrals(flight, position, g)
    squared, lookups = integrals.of(tracker)
    check_mean(samples.round.moments, expected, alpha / 4)
    check_count(samples.lookups, lookups, alpha / 4)
    check_variance(samples.score, squared - expected**2, alpha / 4)
    share = integrals.shares(tracker, samples.t)[~samples.escaped]
    require(np.array([stats.kstest(share, "uniform").pvalue]), alpha / 4, "distances (KS)")


for place, (name, given) in itertools.product(PLACES, SAMPLERS.items()):
    # what scores 1 / distance^2 has no fourth moment to speak of where that is small
    if place == "outside" or name not in ("delta", "tabulated"):
        (tracker,) = given
        options = {"sampler": given, "place": place, "kernels": f"scattering/light/{tracker}"}
        checks.one(f"scattering/moments/{place}/{name}", tracker, **options)(moments)
