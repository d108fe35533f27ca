"""Vertices that are drawn together towards a light, once and twice scattered, against float64."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from freepath.checks.double_scattering import double_scattering
from freepath.checks.identities import check_clean, check_mean
from freepath.checks.rig import Flight, Rig
from freepath.checks.suite.common import Checks
from freepath.checks.suite.scattering import FEW, PHASES, PLACES, follow, homogeneous, light
from freepath.measure.stats import Moments

ALBEDO, SIGMA_T = 0.5, 2.0
ONCE = """The phase function is drawn from a table over the angle, which a light beside the ray, far
away or behind it narrows to nothing: the mean must stay that of the integral."""
checks = Checks()


def double(
    rig: Rig, alpha: float, tracker: str, sampler: Any, place: str, g: float, **axes: Any
) -> None:
    """Two vertices have one density, of three variables whose factors cancel: a factor that is lost
    is no more than another light, but for an integral over all of them."""
    # Light that scatters once and twice, against both integrals.
    position = np.array(PLACES[place])
    intensity = 10 * max(1.0, abs(position[2])) ** 2
    twice = _fly(rig, sampler, position, intensity, g, 2, **axes)
    expected = _fly(rig, sampler, position, intensity, g, 1).reference()
    again, error = double_scattering(SIGMA_T, g, position, twice.segments, seed=rig.seed)
    factor = ALBEDO**2 * intensity
    one = twice.run(32768)
    check_clean(one, bounded=True)
    # the reference has an error of its own, which counts as one of the mean
    count = one.moments.count
    deviations = one.moments.m2 + (error * factor) ** 2 * count * (count - 1)
    check_mean(Moments(count, one.moments.mean, deviations), expected + again * factor, alpha)


def _fly(
    rig: Rig, sampler: Any, position: Any, intensity: float, g: float, scatterings: int, **axes: Any
) -> Flight:
    return follow(
        rig,
        sampler,
        homogeneous(SIGMA_T, albedo=ALBEDO, g=g),
        light={"point": {"position": position.tolist(), "intensity": float(intensity)}},
        scatterings=scatterings,
        shadow="analytic",
        rays=FEW,
        **axes,
    )


def _one(name: str, situation: Any, *labels: str, **options: Any) -> None:
    tracker = options.pop("tracker", "joint")
    checks.one(f"scattering/{name}", tracker, labels=labels, **options)(situation)


for place, (phase, g) in itertools.product(PLACES, PHASES.items()):
    options = {"sampler": {"joint": {}}, "place": place, "g": g}
    _one(f"light/{place}/joint-{phase}", light, "fast", sentence=ONCE, **options)
    _one(f"double/{place}/joint-{phase}", double, "slow", **options)
for name, given in {"cells": {"cells": 1}, "share": {"share": 0.9}}.items():
    few = {"sampler": {"joint": given}, "place": "inside", "g": 0.9}
    _one(f"double/inside/joint-{name}", double, "slow", **few)
plain = {"sampler": "delta", "place": "outside", "g": 0.0, "tracker": "delta"}
_one("double/outside/delta", double, "slow", **plain)
