"""Rays where walks break, scenes of any size and place, and neighbours of 0 and a million."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from freepath.checks.cases import check_samples
from freepath.checks.identities import check_clean, check_each_ray, largest_events
from freepath.checks.rig import Rig
from freepath.checks.suite.common import UPWARD, VOXELS, Checks, everyone, knows_depth, unit, voxels
from freepath.checks.suite.thickness import WITHIN_1
from freepath.checks.verdict import demand
from freepath.compose.catalog import Tracker

Lines = tuple[np.ndarray, np.ndarray]
UNITS = {"1e-6": 1e-6, "1e6": 1e6}


def lines_of_all_kinds() -> dict[str, tuple[Any, Any]]:
    """Origins and directions in a unit cube, by what is special about them."""
    kinds: dict[str, tuple[Any, Any]] = {}
    axes = np.vstack([np.eye(3), -np.eye(3)])
    # beside the ray: the middle of a cell, a face, an edge, faces and edges of the box
    places = {
        "axis": [(0.3125, 0.6875)],
        "face": [(0.25, 0.6875), (0.7, 0.5)],
        "edge": [(0.25, 0.5)],
        "box-face": [(0.0, 0.3), (1.0, 0.3)],
        "box-edge": [(0.0, 1.0), (1.0, 1.0)],
    }
    for kind, some in places.items():
        along = list(itertools.product(axes, some))
        origins = [np.insert(p, np.abs(a).argmax(), 0.5) - 2.0 * a for a, p in along]
        kinds[kind] = (origins, [axis for axis, _ in along])
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
    kinds["corner"] = (corners - (1.0 - 2.0 * corners), 1.0 - 2.0 * corners)
    kinds["from-corner"] = (corners, 1.0 - 2.0 * corners)
    kinds["voxel-corner"] = (
        [[0.5, 0.5, 0.5] - 2.0 * d for d in unit([[1, 2, 3], [-1, 1, 2], [3, -1, 1]])],
        [[1, 2, 3], [-1, 1, 2], [3, -1, 1]],
    )
    kinds["along-face"] = ([[0.25, -1, -1], [0.5, 2, -1]], [[0, 1, 1], [0, -1, 1]])
    kinds["boundary"] = ([[0, 0.3, 0.4], [1, 0.3, 0.4]], [[1, 0.2, 0.3], [-1, 0.2, -0.3]])
    kinds["inside"] = ([[0.25, 0.5, 0.5], [0.3, 0.4, 0.2]], [[1, 0.2, 0.3], [0, 0, -1]])
    kinds["all-but-parallel"] = (
        [[-1, 0.25, 0.3], [-1, 0.25, 0.3], [-1, 0.5 - 1e-9, 0.3]],
        [[1, 1e-7, 0], [1, -1e-9, 1e-8], [1, 1e-9, 1e-9]],
    )
    kinds["denormal"] = ([[-1, 0.26, 0.3], [-1, 0.25, 0.5]], [[1, 1e-310, -1e-300], [1, -1e-38, 0]])
    return kinds


def without_length() -> Lines:
    """Rays that miss, that only touch an edge or a corner, or start where they leave."""
    origins = [[2, 2, 2], [-1, 0.5, 0.5], [-1, 1.5, 0.5], [-1, 1, 0.5], [3, -1, 0.5], [1, 0.5, 0.5]]
    directions = [[1, 0, 0], [-1, 0, 0], [1, 0, 0], [1, -1, 0], [-1, 1, 0], [1, 0.5, 0]]
    origins += [[-1, -1, -1], [3, 0, 0]]
    directions += [[0, 0, 1], [-1, 1, 0]]
    return np.array(origins, float), unit(directions)


LINES = {kind: (np.array(a, float), unit(b)) for kind, (a, b) in lines_of_all_kinds().items()}


checks = Checks()


def special(rig: Rig, alpha: float, tracker: Tracker, kind: str) -> None:
    """A ray along an axis divides by 0; on a face, edge or corner planes tie, and a walk stalls,
    skips a cell, or leaves the box by rounding."""
    # Ray by ray: one that goes wrong must not hide among others. Voxels are interpolated or not in
    # turn.
    lines = LINES[kind]
    repeated = tuple(np.tile(array, (4, 1)) for array in lines)
    nearest = (len(kind) + len(tracker.name)) % 2 == 0
    interpolation = "nearest" if nearest else "trilinear"
    flight = voxels(rig, tracker, VOXELS, lines=repeated, interpolation=interpolation)
    demand((flight.segments[:, 6] > 0.1).all(), "a ray that should have a length has none")
    samples = flight.record(2048)
    if nearest and kind == "all-but-parallel" and not knows_depth(tracker):
        # which voxel such a ray is in is left to rounding, but lookups and walks must agree on it
        check_clean(samples.round, bounded=True)
        return
    check_samples(flight, samples, alpha / 2)
    if samples.round.variance and tracker.unbiased:
        events = largest_events(samples.score)
        check_each_ray(samples.round.moments, flight.reference(), events, alpha / 2)


@checks.hard("geometry/no-length", everyone)
def no_length(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A ray that misses, is tangent or starts where it leaves has no length: it escapes with the
    weight 1, and nothing is divided by its length."""
    flight = voxels(rig, tracker, VOXELS, lines=without_length())
    demand((flight.segments[:, 6] == 0.0).all(), "a ray that should have no length has one")
    samples = flight.record(16)
    check_clean(samples.round, bounded=True)
    expected = 1.0 if flight.case.estimand == "transmittance" else 0.0
    worst = np.abs(samples.score - expected).max()
    demand(worst == 0.0, f"scores differ from {expected} by {worst:.3g}")


@checks.hard("geometry/crossings", lambda t: t.name == "ratio")
def crossings(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A walk that stalls crosses a plane twice, one that skips does not: the number of planes is
    known."""
    # Along diagonals, where planes tie and rounding decides; lookups/as-derived has chords.
    ties = voxels(rig, tracker, VOXELS, lines=LINES["corner"]).run(1).counters["crossings"]
    demand(3 * 8 <= ties <= 4 * 8, f"{ties} crossings of 8 diagonals, expected 24 to 32")


def scaled(rig: Rig, alpha: float, tracker: Tracker, length: float) -> None:
    """The same scene in other units has the same transmittance, unless an epsilon has a unit, or
    powers of lengths leave the range of a float."""
    origins, directions = LINES["axis"]
    flight = voxels(rig, tracker, VOXELS, length, lines=(origins * length, directions))
    check_samples(flight, flight.record(2048), alpha)
    usual = voxels(rig, tracker, VOXELS, lines=(origins, directions)).reference()
    scale = length if flight.case.estimand == "free_path" else 1.0
    error = np.abs(flight.reference() / (scale * usual) - 1.0).max()
    demand(error < 1e-6, f"the reference differs by {error:.3g} between units")


@checks.hard("scale/from-afar", everyone)
def from_afar(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A ray from a million units away cancels in p - box if that is left to float32: it must enter
    where it does, to the stated bound."""
    # A million away, towards the cube: as from beside it, to 1e-9 of a million.
    random = np.random.default_rng(12)
    targets = 0.2 + 0.6 * random.random((64, 3))
    directions = unit(random.normal(size=(64, 3)))
    near, far = (
        voxels(rig, tracker, VOXELS, lines=(targets - away * directions, directions))
        for away in (2.0, 1e6)
    )
    check_samples(far, far.record(2048), alpha)
    error = np.abs(near.segments - far.segments).max()
    demand(error < 1e-2 * 2.0**-10, f"the same ray from afar is off by {error:.3g}")


@checks.hard("contrast/million", everyone)
def contrast(
    rig: Rig, alpha: float, tracker: Tracker, ends: tuple[float, float] = (1e6, 1e-42), **axes: Any
) -> None:
    """Between neighbours of 0 and 10^6 interpolation and majorants overflow their neighbours, and a
    denormal density is flushed or divided by."""
    # Through a voxel of 10^6, one of a denormal density, and past both; or of other `ends`.
    count = 4
    values = np.zeros((count,) * 3)
    values[1, 1::2, 2], values[2, 1, :], values[3, 3, :] = *ends, 1.0
    lines = None
    if not knows_depth(tracker):
        middles = (np.arange(count) + 0.5) / count
        y, z = (place.ravel() for place in np.meshgrid(middles, middles))
        origins = np.column_stack([np.full(count**2, -1.0), y, z])
        lines = origins, np.tile([1.0, 0.0, 0.0], (count**2, 1))
    # the rays of a chord meet the voxel where it is interpolated: few samples, of many lookups
    axes |= {"rays": UPWARD, "interpolation": "nearest"}
    flight = voxels(rig, tracker, values, lines=lines, **axes)
    samples = flight.record(2)
    demand(not samples.round.counters["nonfinite"], "scores are no numbers")
    demand(not samples.round.counters["violations"], "violations of a majorant that bounds")
    if flight.case.estimand != "transmittance" or samples.round.counters["truncated"]:
        return
    expected = flight.reference()
    thick, clear = expected < 1e-30, expected > 0.9999999
    worst = np.abs(samples.score[thick]).max(initial=0.0)
    demand(worst < 1e-6 or tracker.name not in WITHIN_1, f"{worst:.3g} comes through {ends[0]:g}")
    lost = np.abs(samples.score[clear] - 1.0).max(initial=0.0)
    demand(lost < 1e-3, f"{lost:.3g} is lost beside it")


for kind in LINES:
    checks.hard(f"geometry/{kind}", everyone, kind=kind)(special)
for name, length in UNITS.items():
    checks.hard(f"scale/{name}", everyone, length=length)(scaled)
