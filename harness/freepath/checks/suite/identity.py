"""Means and distributions: every tracker x estimand x medium, with majorants, lanes and tightness
going round, so that each value meets each medium without a kernel for every combination."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from freepath.checks import cases
from freepath.checks.generators import first_depths
from freepath.checks.media import MAJORANTS, MEDIA
from freepath.checks.model import Check, needs_double
from freepath.checks.rig import Rig
from freepath.compose.catalog import Catalog, Tracker
from freepath.config.axes import ALONG_PATHS
from freepath.config.models import MEDIA as MODELS

Axes = dict[str, Any]

WALKS = MAJORANTS | {"octree": {"octree": {"resolution": 8}}}
FAST = ("homogeneous", "trilinear")
DRAW_FIRST = ("analytic", "regular")
IN_DOUBLE = ("gaussian", "cosine", "trilinear")
"""Media without boundaries, which the kernel reads in single precision whatever its arithmetic."""
PATHS = 256


def checks(catalog: Catalog) -> Iterator[Check]:
    """Means of all trackers, distributions of unbiased ones, inversions of those that draw one."""
    for tracker in catalog.trackers.values():
        for axes in cases_of(tracker):
            yield _check(axes, "identity", mean)
            if axes["estimand"] != "free_path":
                continue
            if tracker.unbiased and tracker.name not in SCORES_ON_ITS_WAY:
                yield _check(axes, "distribution", distribution)
            if tracker.name in DRAW_FIRST:
                yield _check(axes, "inversion", inversion)
                if axes["medium"] in IN_DOUBLE:
                    double = axes | {"arithmetic": "double", "lanes": 4}
                    yield _check(double, "inversion-double", inversion)


SCORES_ON_ITS_WAY = ("split",)
"""Where its flight ends is no free path: what it deposits is."""


def cases_of(tracker: Tracker) -> list[Axes]:
    """Every estimand x medium that the tracker allows."""
    majorants = ["global"]
    if "majorant" in tracker.needs:
        majorants = [name for name in WALKS if name in tracker.majorants]
    tightness = [1, 2] if tracker.bounding else [1, 2, 0.8]
    found = []
    single = [name for name in tracker.estimands if name not in ALONG_PATHS]
    for e, estimand in enumerate(single):
        for m, medium in enumerate(MEDIA):
            (kind,) = MEDIA[medium]
            if tracker.needs - {"majorant", "control"} - MODELS[kind].OFFERS:
                continue
            turn = e + m
            axes = {"tracker": tracker.name, "estimand": estimand, "medium": medium}
            axes |= {"majorant": majorants[turn % len(majorants)], "lanes": (16, 1)[turn % 2]}
            found.append(axes | {"tightness": tightness[turn % len(tightness)]})
    return found


def name_of(axes: Axes) -> str:
    """What a case is called after the kind of its check."""
    return "/".join(axes[axis] for axis in ("tracker", "estimand", "medium", "majorant"))


def _check(axes: Axes, kind: str, function: Any) -> Check:
    name, double = name_of(axes), "arithmetic" in axes
    speed = "fast" if axes["medium"] in FAST and not double else "slow"
    labels = (speed, "identity" if kind == "identity" else "distribution", axes["tracker"])
    options = {"applies": needs_double} if double else {}
    options["axes"] = axes | {"majorant": WALKS[axes["majorant"]]}
    return Check.of(f"{kind}/{name}", labels, function, kernels=name, **options)


def mean(rig: Rig, alpha: float, axes: Axes) -> None:
    """A wrong probability, weight, majorant or walk biases the mean: it must agree with float64 for
    thin and for thick rays, and samples must neither share random numbers nor lose their end."""
    cases.check_case(rig, axes, alpha)


def distribution(rig: Rig, alpha: float, axes: Axes) -> None:
    """Free paths could have the right mean and the wrong distribution: their optical depths must
    pass chi-square and Kolmogorov-Smirnov tests, weighted where the tracker's are."""
    # With looser majorants, another seed and more samples.
    flight = rig.flight(**axes | {"tightness": 3}, seed=rig.seed + 77)
    cases.check_distribution(flight, flight.record(512), alpha)


def inversion(rig: Rig, alpha: float, axes: Axes) -> None:
    """An inversion that stops too early or loses digits shifts single paths by too little to be
    seen in a mean: each must end where the optical depth is reached that was drawn for it."""
    flight = rig.flight(**axes)
    samples = flight.record(PATHS)
    cases.check_each_path(flight, samples, first_depths(rig.seed, *samples.t.shape))
