"""Majorants and controls of a medium: for all of it, or for each cell of a grid or an octree."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from freepath.scene import Medium
from freepath.scene.octree import leaf_sizes, over_leaves

PER_LENGTH = ("cells_per_x", "cells_per_y", "cells_per_z")
POINTS = 4
"""Points along each side of a cell that its mean is taken over: a control may be any number."""


@dataclass(frozen=True)
class Majorant:
    """What a kernel reads of a majorant: its numbers, and float32 arrays one behind another."""

    numbers: dict[str, float]
    data: np.ndarray | None = None
    control_excess: float = 0.0
    """How far the control lies above the extinction at most, relative to the highest extinction."""


EXCESS = 1e-6
"""How far above the extinction a control may be by rounding, relative to the majorant."""


@dataclass(frozen=True)
class Cells:
    """Bounds and means of the extinction (1/world length) over cells [nz, ny, nx]."""

    lower: np.ndarray
    upper: np.ndarray
    means: np.ndarray | None = None
    sizes: np.ndarray | None = None
    """Finest cells along a side of the leaf that each cell belongs to, of an octree."""


def numbers_of(model: Any, needs: frozenset[str]) -> tuple[str, ...]:
    """The names of the numbers that `build` gives, in the order in which a kernel reads them."""
    if model is None:
        return ()
    if model.kind == "global":
        return ("residual", "control") if "control" in needs else ("sigma_t",)
    counts = ("nx", "ny", "nz") if model.kind == "grid" else ("resolution",)
    return (*counts, *PER_LENGTH, "cells")


def cells_of(model: Any) -> tuple[int, int, int]:
    """The cells (nx, ny, nz) over which a config's majorant bounds the medium."""
    if model.kind == "octree":
        return (model.resolution,) * 3
    return (1, 1, 1) if model.kind == "global" else tuple(model.resolution)


def bytes_of(model: Any, control: Any) -> int:
    """What a config's majorant takes at most while it is made, its copy on a device included.

    Over its cells these are float64 arrays; what a kernel reads are float32 arrays, each of them
    twice and two more in the making; means are taken over the points of a layer of cells.
    """
    octree, controlled, (nx, ny, _) = model.kind == "octree", control is not None, cells_of(model)
    layer = nx * ny * POINTS**3 * 64 if control == "mean" else 0
    per_cell, arrays = 32 + 48 * controlled + 32 * octree, 1 + controlled + octree
    stored = math.prod(_stored(model)) * 8 * (arrays + 1)
    return math.prod(cells_of(model)) * per_cell + stored + layer


def _stored(model: Any) -> tuple[int, ...]:
    """The cells (nx, ny, nz) that a kernel reads.

    The walk through a grid may step one cell too far where rounding puts a plane just inside the
    ray's end, so a grid has a border; that through an octree holds its cell inside.
    """
    border = 1 if model.kind == "grid" else 0
    return tuple(n + 2 * border for n in cells_of(model))


def build(
    model: Any,
    medium: Medium,
    bounds: tuple[np.ndarray, np.ndarray],
    tightness: float,
    control: Mapping[str, Any] | None = None,
) -> Majorant:
    """Make a majorant from the medium's bounds over `cells_of(model)`, times tightness.

    `bounds` are minorant and majorant of each cell, [nz, ny, nx] (1/world length). With `control`
    (a tracker's parameters `control` and `share`) the extinction less the control is bounded
    instead: |sigma_t - control| in each cell, times tightness.
    """
    cells = _joined(
        model, medium, bounds, with_means=bool(control) and control["control"] == "mean"
    )
    if control is None:
        return _packed(model, medium, [cells.upper * tightness, cells.sizes, None])
    controls = _controls(cells, control)
    residual = np.maximum(cells.upper - controls, controls - cells.lower) * tightness
    excess = float((controls - cells.lower).max() / max(cells.upper.max(), np.finfo(float).tiny))
    made = _packed(model, medium, [residual, cells.sizes, controls])
    return replace(made, control_excess=excess)


def _packed(model: Any, medium: Medium, arrays: list[np.ndarray | None]) -> Majorant:
    """Numbers of one cell, or arrays behind each other of many: majorants, sizes, controls."""
    given = [array for array in arrays if array is not None]
    if model.kind == "global":
        names = ("sigma_t",) if len(given) == 1 else ("residual", "control")
        return Majorant({n: float(a[0, 0, 0]) for n, a in zip(names, given, strict=True)})
    cells = cells_of(model)
    numbers: dict[str, float] = {"resolution": cells[0]}
    if model.kind == "grid":
        numbers = {f"n{axis}": n for axis, n in zip("xyz", cells, strict=True)}
    per_length = np.array(cells) / medium.extent
    numbers |= dict(zip(PER_LENGTH, per_length.tolist(), strict=True))
    stored = _stored(model)
    border = (stored[0] - cells[0]) // 2
    data = np.empty((len(given), *reversed(stored)), np.float32)
    for one, array in zip(data, given, strict=True):
        one[...] = np.pad(array.astype(np.float32), border, mode="edge")
    numbers["cells"] = data[0].size
    return Majorant(numbers, data)


def _joined(
    model: Any, medium: Medium, bounds: tuple[np.ndarray, np.ndarray], *, with_means: bool
) -> Cells:
    """The cells of a config's majorant; those of an octree have the values of their leaves."""
    lower, upper = bounds
    means = _means(medium, cells_of(model), lower, upper) if with_means else None
    if model.kind != "octree":
        return Cells(lower, upper, means)
    sizes = leaf_sizes(upper, model.slack)
    if means is not None:
        means = over_leaves(means, sizes, np.mean)
    lower, upper = over_leaves(lower, sizes, np.min), over_leaves(upper, sizes, np.max)
    return Cells(lower, upper, means, sizes)


def _controls(bounds: Cells, control: Mapping[str, Any]) -> np.ndarray:
    base = {
        "minorant": bounds.lower,
        "middle": (bounds.lower + bounds.upper) / 2,
        "mean": bounds.means,
        "number": np.ones_like(bounds.lower),
    }[control["control"]]
    return base * control["share"]


def _means(medium: Medium, cells: tuple, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The mean extinction of each cell [nz, ny, nx], from points; of the whole box exactly."""
    if cells == (1, 1, 1):
        return np.full((1, 1, 1), medium.mean())
    axes = [
        (np.arange(n * POINTS) + 0.5) * (extent / (n * POINTS))
        for n, extent in zip(cells, medium.extent, strict=True)
    ]
    means = np.zeros_like(lower)
    for layer in range(cells[2]):
        heights = axes[2][layer * POINTS : (layer + 1) * POINTS]
        z, y, x = np.meshgrid(heights, axes[1], axes[0], indexing="ij")
        values = medium.sigma_t(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1))
        shape = (POINTS, cells[1], POINTS, cells[0], POINTS)
        means[layer] = values.reshape(shape).mean(axis=(0, 2, 4))
    return np.clip(means, lower, upper)
