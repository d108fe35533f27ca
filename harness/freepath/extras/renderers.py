"""What renderers have of what is measured here, and how the settings are called there."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Axes = dict[str, Any]
TIGHT: Axes = {"tightness": 1}
RATES = (0.5, 1, 2, 4)
"""Steps of marching in voxels, where a renderer has a step."""


@dataclass(frozen=True)
class Renderer:
    """A renderer of one version."""

    title: str
    points: Callable[[str, int, float], list[Axes]]
    """Of the tracker of null collisions, the finest octree's resolution, a voxel's side."""
    settings: Callable[[Axes, float], str]
    """What to change there for one of its points."""
    source: str


def contains(axes: Any, point: Any) -> bool:
    """Whether a point says nothing else than axes, of which it may leave out some."""
    if isinstance(point, dict):
        return isinstance(axes, dict) and all(
            key in axes and contains(axes[key], value) for key, value in point.items()
        )
    if isinstance(point, float) and isinstance(axes, (int, float)):
        return math.isclose(axes, point, rel_tol=1e-6)
    return bool(axes == point)


def _grid(cells: int) -> Axes:
    return {"grid": {"resolution": [cells] * 3}}


def _of_pbrt(point: Axes, side: float) -> str:
    kind = "uniformgrid" if contains(point["majorant"], _grid(16)) else "nanovdb"
    cells = 16 if kind == "uniformgrid" else 64
    return (
        f'MakeNamedMedium with "string type" "{kind}", Integrator "volpath": its majorants have '
        f"{cells} x {cells} x {cells} cells, which no parameter changes"
    )


def _of_cycles(point: Axes, side: float) -> str:
    if "march" not in point["tracker"]:
        return "Render > Volumes: Biased off (cycles.volume_biased = False); it has no step then"
    rate = point["tracker"]["march"]["step"] / side
    return (
        f"Render > Volumes: Biased on (cycles.volume_biased = True), Step Rate Render {rate:.3g} "
        f"(cycles.volume_step_rate), Max Steps (cycles.volume_max_steps) above the voxels of a "
        f"diagonal / {rate:.3g}"
    )


def _cycles_points(tracker: str, finest: int, side: float) -> list[Axes]:
    jittered = {"placement": "jittered"}
    marches = [
        TIGHT | {"majorant": "global", "tracker": {"march": jittered | {"step": rate * side}}}
        for rate in RATES
    ]
    unbiased = {"tracker": {tracker: {}}, "majorant": {"octree": {"resolution": finest}}}
    return [*marches, TIGHT | unbiased]


RENDERERS = {
    "mitsuba": Renderer(
        "Mitsuba 3",
        lambda tracker, finest, side: [TIGHT | {"tracker": {tracker: {}}, "majorant": "global"}],
        lambda point, side: (
            "medium `heterogeneous`, integrator `volpath`: nothing to change; its "
            "one majorant is the largest extinction, which no documented parameter refines"
        ),
        "mitsuba.readthedocs.io: plugins heterogeneous, volpath",
    ),
    "pbrt": Renderer(
        "pbrt-v4",
        lambda tracker, finest, side: [
            TIGHT | {"tracker": {tracker: {}}, "majorant": _grid(cells)} for cells in (16, 64)
        ],
        _of_pbrt,
        "pbrt.org/fileformat-v4 (Media), and the two grids in src/pbrt/media",
    ),
    "cycles": Renderer(
        "Cycles of Blender 5.0",
        _cycles_points,
        _of_cycles,
        "docs.blender.org/manual, 5.0: Render Settings, Volumes; its tree of bounds is taken for "
        "the octree here",
    ),
}
