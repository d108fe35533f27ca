"""A few paths of each tracker: what even an interpreter, which checks every access, can fly."""

from __future__ import annotations

import numpy as np

from freepath.checks.identities import check_clean
from freepath.checks.model import TINY
from freepath.checks.rig import Rig
from freepath.checks.suite.common import FEW, UPWARD, Checks, everyone, fly, knows_depth
from freepath.checks.verdict import demand
from freepath.compose.catalog import Tracker

SAMPLES = 4
SCATTERING = ("delta", "combined", "equiangular", "joint", "regular", "spectral", "tabulated")


SMOKE = ("fast", "smoke", TINY)
checks = Checks()


@checks.each("smoke", everyone, SMOKE)
def few_paths(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A read beyond an array or of what nobody has written gives right answers until it does not:
    an interpreter must have no complaint, and paths must end on their ray."""
    medium = "exponential" if knows_depth(tracker) else "trilinear"
    flight = fly(rig, tracker, medium, rays=FEW, lanes=1)
    samples = flight.record(SAMPLES)
    check_clean(samples.round, bounded=True)

    demand(np.isfinite(samples.score).all(), "a score is no number")
    beyond = samples.t > flight.segments[:, 6:] * (1.0 + 16.0 * flight.rounding)
    demand(not beyond.any() and (samples.t >= 0.0).all(), "a path ends beyond its ray")


@checks.each("smoke/scattering", lambda t: t.name in SCATTERING, (*SMOKE, "scattering"))
def few_scatterings(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """Paths that scatter copy rays, weights and states of lanes that are not there: an interpreter
    must have no complaint, and what is brought be a number above 0."""
    channels = {"channels": [1, 0.5]} if tracker.name == "spectral" else {}
    medium = {"cloud": {"resolution": 8, "sigma_t": 4, "albedo": 0.9, "g": 0.3} | channels}
    light = {"point": {"position": [0.3, 0.4, 2.0], "intensity": 10}}
    axes = {"estimand": "radiance", "light": light, "scatterings": 2, "majorant": "grid"}
    axes["shadow"] = "spectral_ratio" if channels else "ratio"
    # of 64 paths along these rays 35 collide, so none does in a run of 1e15; chords may be short
    one = rig.flight(
        tracker=tracker.name, medium=medium, rays=UPWARD, lanes=1, record=False, **axes
    ).run(SAMPLES)
    check_clean(one, bounded=True)
    mean = one.moments.mean
    demand(np.isfinite(mean).all() and (mean >= 0.0).all(), "a radiance below 0, or no number")
    demand(mean.any(), "no light at all")
