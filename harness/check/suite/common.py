"""What the hard cases share: the same few kernels for many situations of a tracker."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from freepath.catalog import Catalog, Tracker
from freepath.check.model import Check, always, majorant_of, of_tracker
from freepath.check.rig import Flight, Rig

FEW = {"chords": {"count": 16}}
UPWARD = {"orthographic": {"resolution": [4, 4]}}
GRID = {"grid": {"resolution": 4}}
CELLS = 8
# A unit cube of which about half of the voxels are empty.
_RANDOM = np.random.default_rng(4)
VOXELS = 4.0 * _RANDOM.random((CELLS,) * 3) * (_RANDOM.random((CELLS,) * 3) > 0.5)

Wanted = Callable[[Tracker], bool]


def hard(
    catalog: Catalog, situation: tuple[str, str, Any], wanted: Wanted, sentence: str, **options: Any
) -> Iterator[Check]:
    """A check of each tracker that a situation (group, name, function) applies to.

    `options` may have `speed`, `applies` and what the function is to be called with beside.
    """
    group, name, function = situation
    speed, applies = options.pop("speed", "fast"), options.pop("applies", always)
    for tracker in catalog.trackers.values():
        if wanted(tracker):
            yield Check(
                f"hard/{group}/{name}/{tracker.name}",
                (speed, "hard", group, tracker.name),
                sentence,
                of_tracker(tracker, function, **options),
                applies,
                tracker.name,
            )


def everyone(tracker: Tracker) -> bool:
    """Every tracker that flies: not one that only looks up."""
    return not {"transmittance", "free_path"}.isdisjoint(tracker.estimands)


def walks(tracker: Tracker) -> bool:
    """Trackers that use a majorant."""
    return "majorant" in tracker.needs


def splits_off(tracker: Tracker) -> bool:
    """Trackers that use a control."""
    return "control" in tracker.needs


def knows_depth(tracker: Tracker) -> bool:
    """Trackers that work on closed forms: these have no voxels."""
    return "closed_form" in tracker.needs


def has_free_path(tracker: Tracker) -> bool:
    """Trackers of free paths."""
    return "free_path" in tracker.estimands


def fly(rig: Rig, tracker: Tracker, medium: Any, length: float = 1.0, **axes: Any) -> Flight:
    """Build a case of a tracker in a medium of about this length; most share their kernels."""
    scaled = {
        name: parameter.default * length
        for name, parameter in tracker.parameters.items()
        if parameter.unit == "length" and length != 1.0
    }
    majorant = GRID if majorant_of(tracker) == "grid" else "global"
    parameters = axes.pop("parameters", {}) | scaled
    given = {"majorant": majorant, "lanes": 16, "estimand": tracker.estimands[0]} | axes
    return rig.flight(tracker={tracker.name: parameters}, medium=medium, **given)


def homogeneous(
    rig: Rig, tracker: Tracker, sigma_t: float, length: float = 1.0, **axes: Any
) -> Flight:
    """The same in a cube of one extinction."""
    medium = {"homogeneous": {"sigma_t": sigma_t, "size": length}}
    return fly(rig, tracker, medium, length, **axes)


def voxels(
    rig: Rig, tracker: Tracker, values: np.ndarray, length: float = 1.0, **axes: Any
) -> Flight:
    """The same in a cube of voxels, whose values are optical depths along all of its length.

    A tracker that needs a closed form flies through layers of one column of them.
    """
    interpolation = axes.pop("interpolation", "trilinear")
    if knows_depth(tracker):
        count = len(values)
        column = (values[:, 1, 2] / length).tolist()
        inner = [length * i / count for i in range(1, count)]
        layers = {"breakpoints": inner, "values": column, "size": [length] * 3}
        return fly(rig, tracker, {"layered": layers}, length, **axes)
    size = length / len(values)
    medium = rig.volume(values, voxel_size=size, sigma_t=1.0 / length, interpolation=interpolation)
    return fly(rig, tracker, medium, length, **axes)


def unit(directions: Any) -> np.ndarray:
    """Directions (rays, 3) of length 1."""
    directions = np.array(directions, float)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
