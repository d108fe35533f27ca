"""Majorants and controls of a medium: for all of it, for each cell of a grid or leaf of an octree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from freepath.octree import leaf_sizes, over_leaves
from freepath.scene import Medium

PER_LENGTH = ("cells_per_x", "cells_per_y", "cells_per_z")
POINTS = 4
"""Points along each side of a cell that its mean is taken over: a control may be any number."""


@dataclass(frozen=True)
class Majorant:
    """What a kernel reads of a majorant: its numbers, and float32 arrays behind each other or None."""

    numbers: dict[str, float]
    data: np.ndarray | None = None


@dataclass(frozen=True)
class Cells:
    """Bounds and means of the extinction (1/world length) over the cells of a majorant [nz, ny, nx]."""

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


def build(
    model: Any, medium: Medium, tightness: float, control: Mapping[str, Any] | None = None
) -> Majorant:
    """Bound the medium as the config's majorant says, times tightness (1/world length).

    With `control` (a tracker's parameters `control` and `share`) the extinction less the control is
    bounded instead: |sigma_t - control| in each cell, times tightness.
    """
    counts = {"global": lambda: (1, 1, 1), "octree": lambda: (model.resolution,) * 3}
    cells = tuple(counts.get(model.kind, lambda: model.resolution)())
    bounds = _bounds(model, medium, cells, with_means=bool(control) and control["control"] == "mean")
    majorants, controls = bounds.upper * tightness, None
    if control:
        controls = _controls(bounds, control)
        residual = np.maximum(bounds.upper - controls, controls - bounds.lower)
        majorants = residual * tightness
    if model.kind == "global":
        values = (majorants,) if controls is None else (majorants, controls)
        names = ("sigma_t",) if controls is None else ("residual", "control")
        return Majorant({n: float(v[0, 0, 0]) for n, v in zip(names, values, strict=True)})
    return _arrays(model, medium, cells, [majorants, bounds.sizes, controls])


def _arrays(model: Any, medium: Medium, cells: tuple, arrays: list) -> Majorant:
    numbers = {"resolution": cells[0]}
    if model.kind == "grid":
        numbers = {f"n{axis}": n for axis, n in zip("xyz", cells, strict=True)}
    per_length = np.array(cells) / medium.extent
    numbers |= dict(zip(PER_LENGTH, per_length.tolist(), strict=True))
    # The walk through a grid may step one cell too far where rounding puts a plane just inside the
    # ray's end; that through an octree holds its cell inside.
    padding = 1 if model.kind == "grid" else 0
    padded = [np.pad(array, padding, mode="edge") for array in arrays if array is not None]
    numbers["cells"] = padded[0].size
    return Majorant(numbers, np.stack(padded).astype(np.float32))


def _bounds(model: Any, medium: Medium, cells: tuple, *, with_means: bool) -> Cells:
    lower, upper = medium.bounds(cells)
    means = _means(medium, cells, lower, upper) if with_means else None
    if model.kind != "octree":
        return Cells(lower, upper, means)
    sizes = leaf_sizes(upper, model.slack)
    joined = means if means is None else over_leaves(means, sizes, np.mean)
    return Cells(
        over_leaves(lower, sizes, np.min), over_leaves(upper, sizes, np.max), joined, sizes
    )


def _controls(bounds: Cells, control: Mapping[str, Any]) -> np.ndarray:
    base = {
        "minorant": bounds.lower,
        "middle": (bounds.lower + bounds.upper) / 2,
        "mean": bounds.means,
        "number": np.ones_like(bounds.lower),
    }[control["control"]]
    return base * control["share"]


def _means(medium: Medium, cells: tuple, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The mean extinction of each cell [nz, ny, nx], from points inside; of the whole box exactly."""
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
