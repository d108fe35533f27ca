"""A few paths of each tracker: what even an interpreter, which checks every access, can fly."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from freepath.catalog import Catalog, Tracker
from freepath.check.identities import check_clean
from freepath.check.model import TINY, Check, of_tracker
from freepath.check.rig import Rig
from freepath.check.suite.common import FEW, UPWARD, everyone, fly, knows_depth
from freepath.check.verdict import demand

SAMPLES = 4
SCATTERING = ("delta", "combined", "equiangular", "joint", "regular", "spectral", "tabulated")


def checks(catalog: Catalog) -> Iterator[Check]:
    """One of each tracker."""
    for tracker in catalog.trackers.values():
        if everyone(tracker):
            yield Check(
                f"smoke/{tracker.name}",
                ("fast", "smoke", TINY, tracker.name),
                "A read beyond an array or of what nobody has written gives right answers until it "
                "does not: an interpreter must have no complaint, and paths must end on their ray.",
                of_tracker(tracker, few_paths),
                kernels=f"smoke/{tracker.name}",
            )
        if tracker.name in SCATTERING:
            yield Check(
                f"smoke/scattering/{tracker.name}",
                ("fast", "smoke", TINY, "scattering", tracker.name),
                "Paths that scatter copy rays, weights and states of lanes that are not there: an "
                "interpreter must have no complaint, and what is brought be a number above 0.",
                of_tracker(tracker, few_scatterings),
                kernels=f"smoke/scattering/{tracker.name}",
            )


def few_paths(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """Sixteen rays, four samples of each, one lane."""
    medium = "exponential" if knows_depth(tracker) else "trilinear"
    flight = fly(rig, tracker, medium, rays=FEW, lanes=1)
    samples = flight.record(SAMPLES)
    check_clean(samples.round, bounded=True)

    demand(np.isfinite(samples.score).all(), "a score is no number")
    beyond = samples.t > flight.segments[:, 6:] * (1.0 + 16.0 * flight.rounding)
    demand(not beyond.any() and (samples.t >= 0.0).all(), "a path ends beyond its ray")


def few_scatterings(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """The same, scattered twice in the light of a point."""
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
