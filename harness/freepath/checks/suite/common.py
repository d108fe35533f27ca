"""What the hard cases share: the same few kernels for many situations of a tracker."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from freepath.checks.model import Check, majorant_of
from freepath.checks.rig import Flight, Rig
from freepath.compose.catalog import Catalog, Tracker

FEW = {"chords": {"count": 16}}
UPWARD = {"orthographic": {"resolution": [4, 4]}}
GRID = {"grid": {"resolution": 4}}
COUNTS = (12, 4, 8)
# A unit cube [z, y, x] of which about half of the voxels are empty. The counts differ, and so do
# the sizes of a voxel: a stride or size of another axis shows. Faces are at each quarter of it.
_RANDOM = np.random.default_rng(4)
VOXELS = 4.0 * _RANDOM.random(COUNTS) * (_RANDOM.random(COUNTS) > 0.5)

SHEARED = np.array([[0.6, -0.7, 0.1], [0.9, 0.5, -0.2], [0.0, 0.3, 1.1]])
"""Sides of a cube as columns: turned by half a right angle, stretched and sheared."""

Wanted = Callable[[Tracker], bool]
Labels = tuple[str, ...]
Declare = Callable[[Any], Any]


class Checks:
    """The checks of a module, declared by decorating the functions that make them.

    The docstring of such a function is the sentence of its checks, if they are given no other.
    Beside `sentence`, `applies` and `kernels`, `options` are what the function is called with.
    """

    def __init__(self) -> None:
        self._makers: list[Callable[[Catalog], Iterator[Check]]] = []

    def __call__(self, catalog: Catalog) -> Iterator[Check]:
        for make in self._makers:
            yield from make(catalog)

    def each(self, name: str, wanted: Wanted, labels: Labels, /, **options: Any) -> Declare:
        """A check of each tracker that is wanted: function(rig, alpha, tracker, **options)."""

        def declare(function: Any) -> Any:
            def make(catalog: Catalog) -> Iterator[Check]:
                for tracker in filter(wanted, catalog.trackers.values()):
                    own = {"kernels": tracker.name, "tracker": tracker} | options
                    full = f"{name}/{tracker.name}"
                    yield Check.of(full, (*labels, tracker.name), function, **own)

            self._makers.append(make)
            return function

        return declare

    def hard(self, name: str, wanted: Wanted, /, speed: str = "fast", **options: Any) -> Declare:
        """The same of a hard case, whose name begins with its group."""
        group = name.split("/", maxsplit=1)[0]
        return self.each(f"hard/{name}", wanted, (speed, "hard", group), **options)

    def one(
        self, name: str, tracker: str = "", /, *, labels: Labels = ("fast",), **options: Any
    ) -> Declare:
        """One hard check, of a tracker by name or of none: function(rig, alpha, **options)."""
        group, kind = name.split("/")[:2]

        def declare(function: Any) -> Any:
            own = {"kernels": f"{group}/{kind}/{tracker}"} | options
            if tracker and "tracker" in inspect.signature(function).parameters:
                own["tracker"] = tracker
            found = (labels[0], "hard", group, *labels[1:], *filter(None, [tracker]))
            made = Check.of(f"hard/{name}", found, function, **own)
            self._makers.append(lambda catalog: iter([made]))
            return function

        return declare


def everyone(tracker: Tracker) -> bool:
    """Every tracker that flies: not one that only looks up."""
    return not {"transmittance", "free_path"}.isdisjoint(tracker.estimands)


def walks(tracker: Tracker) -> bool:
    """Trackers that use a majorant."""
    return "majorant" in tracker.needs


def splits_off(tracker: Tracker) -> bool:
    """Trackers that use a control of one's choice."""
    return "control" in tracker.parameters


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
    size = [length / count for count in values.shape[::-1]]
    medium = rig.volume(values, voxel_size=size, sigma_t=1.0 / length, interpolation=interpolation)
    return fly(rig, tracker, medium, length, **axes)


def unit(directions: Any) -> np.ndarray:
    """Directions (rays, 3) of length 1."""
    directions = np.array(directions, float)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
