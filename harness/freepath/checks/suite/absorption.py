"""Paths that are absorbed with a chance of one's choice: each mean must stay what it is."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from freepath.checks.identities import check_clean, check_mean, check_variance
from freepath.checks.rig import Rig
from freepath.checks.suite.channels import check_any, check_channels
from freepath.checks.suite.common import Checks
from freepath.checks.suite.near_light import double
from freepath.checks.suite.scattering import CLOUD, FEW, POINT, follow, homogeneous, rod_model
from freepath.checks.verdict import demand
from freepath.measure.stats import Moments

CHOSEN = (0.0, 0.3, "analog")
WEIGHTED = ("regular", "two_knob", "weighted_delta")
FACTORS, ALBEDOS = [1.0, 0.6, 0.3], [0.9, 0.5, 0.3]
LIMIT = 64
"""Scatterings; what is left of the light after so many with an albedo of a half is no number."""
ROD = """A survival that weights are not divided by, or an albedo that is left to both the chance
and the weight, or to neither, is another medium: the rod model knows what this one reflects."""
AGREE = """Beyond these there is no reference: a chance that is chosen is held against roulette and
against paths that nothing ends, for every light, with lanes of one and of two modes."""
TWICE = "Between two collisions a path survives once: an integral over both knows what is lost."
checks = Checks()


def furnace(rig: Rig, alpha: float, tracker: str, chance: float) -> None:
    """Without absorption every path should go on; those that are absorbed all the same must be made
    up for by the weights of the others, to the last."""
    # Weights grow as much as paths get fewer; with a chance of 0 all bring the same.
    coloured = {"channels": FACTORS} if tracker == "spectral" else {}
    medium = {"cloud": CLOUD | {"sigma_t": 2, "albedo": 1, "g": 0.4} | coloured}
    one = follow(rig, tracker, medium, majorant="grid", rays=FEW, p_absorb=chance).run(8192)
    check_clean(one, bounded=True)
    if chance == 0.0:
        error = np.max(np.abs(one.moments.mean - 1.0))
        demand(error < 1e-5, f"mean: a furnace of 1 is off by {error:.3g}")
    elif tracker == "spectral":
        check_channels(one.moments, np.ones_like(one.moments.mean), alpha)
    else:
        check_mean(one.moments, np.ones(16), alpha)


def rod(
    rig: Rig, alpha: float, tracker: str, albedo: float, chance: float | str, sampler: Any = None
) -> None:
    """Transmission and reflection together; of emission, what is missing of a furnace."""
    flown = sampler or tracker
    seen = sum(rod_model(albedo, 1.0))
    axes = {"p_absorb": chance, "rays": FEW, "tightness": 2}
    keys = {"albedo": albedo, "phase": "rod"}
    one = follow(rig, flown, homogeneous(1.0, **keys), **axes).run(8192)
    check_clean(one, bounded=True)
    check_mean(one.moments, np.full(16, seen), alpha / 2)
    glowing = homogeneous(1.0, emission=1, **keys)
    one = follow(rig, flown, glowing, light="dark", **axes).run(8192)
    check_clean(one, bounded=True)
    check_mean(one.moments, np.full(16, 1 - seen), alpha / 2)


def variance(rig: Rig, alpha: float, tracker: str, chance: float | str) -> None:
    """A mean does not show how often paths are absorbed: the second moment of a weight is what
    another rod gives, whose albedo is albedo^2 / (1 - P_absorb)."""
    # Of paths that bring their weight where they leave.
    # at 0.9 fourth powers of weights grow too fast for a test of a variance
    albedo, depth = 0.8, 1.0
    survival = albedo if chance == "analog" else 1.0 - chance
    second = sum(rod_model(albedo**2 / survival, depth))
    axes = {"estimand": "radiance", "rays": FEW, "lanes": 16, "p_absorb": chance}
    medium = homogeneous(depth, albedo=albedo, phase="rod")
    scores = rig.flight(tracker=tracker, medium=medium, **axes).record(8192).score
    expected = second - sum(rod_model(albedo, depth)) ** 2
    check_variance(scores, np.full(16, expected), alpha)


def channels(rig: Rig, alpha: float, tracker: str, chance: float | str) -> None:
    """Three channels, each with its albedo and optical depth, and one chance for all."""
    seen = [sum(rod_model(albedo, depth)) for albedo, depth in zip(ALBEDOS, FACTORS, strict=True)]
    medium = homogeneous(1.0, albedo=ALBEDOS, phase="rod", channels=FACTORS)
    one = follow(rig, tracker, medium, rays=FEW, tightness=2, p_absorb=chance).run(8192)
    check_clean(one, bounded=True)
    check_channels(one.moments, np.tile(seen, (16, 1)), alpha)


def several(rig: Rig, alpha: float, tracker: str, shadow: str, chance: float) -> None:
    """A cloud between a point light and an environment, bounded, against paths that all go on."""
    medium = {"cloud": CLOUD | {"sigma_t": 10, "albedo": 0.9, "g": 0.4, "emission": 0.5}}
    lamp = {"point_in_environment": {**POINT["point"], "radiance": 0.2}}
    axes = {"light": lamp, "scatterings": 4, "majorant": "grid", "shadow": shadow}
    one = follow(rig, tracker, medium, p_absorb=chance, **axes).run(2048)
    other = follow(rig, tracker, medium, **axes).run(2048, first_sample=10000)
    check_clean(one, bounded=True)
    _agree(one.moments, other.moments, alpha)


def unlimited(rig: Rig, alpha: float, tracker: str) -> None:
    """Without a limit and absorption, against many scatterings; and against roulette."""
    coloured = {"channels": FACTORS, "albedo": [0.5, 0.5, 0.2]} if tracker == "spectral" else {}
    medium = {"cloud": CLOUD | {"sigma_t": 6, "albedo": 0.5, "emission": 0.5} | coloured}
    free = follow(rig, tracker, medium, majorant="grid", p_absorb=0).run(4096)
    check_clean(free, bounded=True)
    for first, scatterings in ((10000, LIMIT), (20000, "unlimited")):
        flight = follow(rig, tracker, medium, majorant="grid", scatterings=scatterings)
        _agree(free.moments, flight.run(4096, first_sample=first).moments, alpha / 2)


def _agree(one: Moments, other: Moments, alpha: float) -> None:
    joint = Moments(one.count, one.mean, one.m2 + other.m2)
    check_any(joint, other.mean, alpha)


def _declare() -> None:
    for tracker, chance in (("delta", 0.0), ("delta", 0.3), ("regular", 0.3), ("spectral", 0.3)):
        _one(f"furnace/{chance}", tracker, furnace, chance=chance)
    given = [("delta", albedo, chance) for albedo, chance in itertools.product((0.3, 0.9), CHOSEN)]
    for tracker, albedo, chance in [*given, *((name, 0.9, 0.3) for name in WEIGHTED)]:
        keys = {"albedo": albedo, "chance": chance, "sentence": ROD}
        _one(f"rod/albedo-{albedo}-{chance}", tracker, rod, **keys)
    # P_absorb 0, P_scatter sigma_s / (sigma_s + |sigma_n|)
    scatter = {"sampler": {"two_knob": {"acceptance": 0.9}}, "albedo": 0.9, "chance": 0.0}
    _one("rod/albedo-0.9-no-absorption", "two_knob", rod, sentence=ROD, **scatter)
    for chance in CHOSEN:
        _one(f"variance/{chance}", "delta", variance, chance=chance)
        _one(f"channels/{chance}", "spectral", channels, chance=chance, sentence=ROD)
    options = {"sampler": "delta", "place": "outside", "g": 0.0, "p_absorb": 0.3}
    _one("double/0.3", "delta", double, "slow", sentence=TWICE, **options)
    for shadow, chance in itertools.product(("ratio", "regular"), (0.0, 0.3)):
        keys = {"shadow": shadow, "chance": chance, "sentence": AGREE}
        _one(f"several/{chance}-{shadow}", "delta", several, **keys)
    for tracker in ("delta", "spectral"):
        _one("unlimited", tracker, unlimited, sentence=AGREE)


def _one(name: str, tracker: str, situation: Any, speed: str = "fast", **options: Any) -> None:
    labels = (speed, "scattering")
    checks.one(f"p_absorb/{name}/{tracker}", tracker, labels=labels, **options)(situation)


_declare()
