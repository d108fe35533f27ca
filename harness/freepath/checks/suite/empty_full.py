"""Nothing, next to nothing, and everything alike."""

from __future__ import annotations

from typing import Any

import numpy as np

from freepath.checks.cases import check_samples
from freepath.checks.identities import check_clean
from freepath.checks.rig import Rig
from freepath.checks.suite.common import (
    Checks,
    everyone,
    fly,
    homogeneous,
    knows_depth,
    unit,
    voxels,
    walks,
)
from freepath.checks.verdict import demand
from freepath.compose.catalog import Tracker

GROUP = "empty-full"
ONE_IN = 256


checks = Checks()


@checks.hard("empty-full/nothing", everyone)
def nothing(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A majorant of 0 is divided by, and 0 x infinity is no number: through nothing a path escapes
    with the weight 1 exactly."""
    # Of voxels and of a homogeneous medium.
    for flight in (voxels(rig, tracker, np.zeros((8,) * 3)), homogeneous(rig, tracker, 0.0)):
        if flight.case.estimand != "transmittance":
            continue
        samples = flight.record(64)
        check_clean(samples.round, bounded=True)
        worst = np.abs(samples.score - 1.0).max()
        demand(worst == 0.0, f"empty space takes {worst:.3g}, expected nothing at all")
        demand(samples.escaped.all() or tracker.name == "track_length", "a collision in nothing")


@checks.hard("empty-full/half-empty", everyone)
def half_empty(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A cell of majorant 0 has no mean free path; what is left of a draw must be carried through it
    unchanged."""
    # The lower half is empty, the upper is not.
    values = np.zeros((16, 4, 12))
    values[8:] = 3.0 * np.random.default_rng(8).random((8, 4, 12))
    flight = voxels(rig, tracker, values, seed=rig.seed + 1)
    check_samples(flight, flight.record(1024), alpha)


@checks.hard("empty-full/one-voxel", lambda t: everyone(t) and not knows_depth(t), speed="slow")
def one_voxel(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """One voxel of 256^3 is missed by a walk that skips a cell, a majorant without the
    interpolation's reach, or an index that overflows."""
    # Half of the rays go through it, half beside it.
    values = np.zeros((ONE_IN,) * 3, np.float32)
    # first in its cell along every axis: interpolation reaches into the cells before
    values[192, 64, 128] = 0.5 * ONE_IN
    offsets = np.random.default_rng(9).normal(size=(2, 64, 3))
    centre = np.array([128.5, 64.5, 192.5]) / ONE_IN
    offsets[1] = np.cross(offsets[0], offsets[1])
    directions = unit(offsets[0])
    starts = [centre - 2.0 * directions, centre - 2.0 * directions + 0.2 * unit(offsets[1])]
    lines = np.concatenate(starts), np.tile(directions, (2, 1))
    fine = {"step": 0.25 / ONE_IN, "steps": ONE_IN}
    axes: dict[str, Any] = {
        "parameters": {n: v for n, v in fine.items() if n in tracker.parameters}
    }
    # as many teeth as that many mean free paths of the majorant
    axes |= {"parameters": {}} if tracker.unbiased else {"tightness": 64}
    medium = rig.volume(values, voxel_size=1 / ONE_IN)
    flight = fly(rig, tracker, medium, lines=lines, **axes)
    samples = flight.record(1024)
    check_samples(flight, samples, alpha)
    moments = samples.round.moments
    # next-flight estimators and the like vary in empty space too
    still = (moments.m2 == 0.0) & (np.arange(len(moments.mean)) >= 64)
    past = np.abs(moments.mean[still] - 1.0).max(initial=0.0)
    demand(past <= 4 * flight.rounding, f"a ray past the voxel loses {past:.3g}")


@checks.hard("empty-full/all-equal", walks)
def all_equal(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A grid of equal voxels is a homogeneous medium: another path there means that the walk or the
    interpolation adds something of its own."""
    axes = {"tightness": 2, "seed": rig.seed + 2}
    grid = voxels(rig, tracker, np.full((8,) * 3, 2.0), **axes)
    # so many that rare high scores are in what a variance tells, also of rays that graze a corner
    one, other = grid.record(2048), homogeneous(rig, tracker, 2.0, **axes).record(2048)
    differing = np.mean(one.lookups != other.lookups)
    demand(differing < 1e-4, f"{differing:.2g} of the paths differ in their lookups")
    error = np.abs(one.round.moments.mean - other.round.moments.mean).max()
    demand(error < 1e-4, f"means differ by {error:.3g}")
    check_samples(grid, one, alpha)
