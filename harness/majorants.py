"""Majorants and controls of a medium: for all of it, or for each cell of a grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from freepath.scene import Medium

GRID = ("nx", "ny", "nz", "cells_per_x", "cells_per_y", "cells_per_z")
POINTS = 4
"""Points along each side of a cell that its mean is taken over: a control may be any number."""


@dataclass(frozen=True)
class Majorant:
    """What a kernel reads of a majorant: its numbers, and a padded grid or None."""

    numbers: dict[str, float]
    data: np.ndarray | None = None


def numbers_of(model: Any, needs: frozenset[str]) -> tuple[str, ...]:
    """The names of the numbers that `build` gives, in the order in which a kernel reads them."""
    if model is None:
        return ()
    controlled = "control" in needs
    if model.kind == "global":
        return ("residual", "control") if controlled else ("sigma_t",)
    return (*GRID, "cells") if controlled else GRID


def build(
    model: Any, medium: Medium, tightness: float, control: Mapping[str, Any] | None = None
) -> Majorant:
    """Bound the medium as the config's majorant says, times tightness (1/world length).

    With `control` (a tracker's parameters `control` and `share`) the extinction less the control is
    bounded instead: |sigma_t - control| in each cell, times tightness.
    """
    cells = (1, 1, 1) if model.kind == "global" else model.resolution
    lower, upper = medium.bounds(cells)
    numbers: dict[str, float] = {}
    arrays = [upper * tightness]
    if control:
        controls = _controls(medium, cells, lower, upper, control)
        residual = np.maximum(upper - controls, controls - lower) * tightness
        arrays = [residual, controls]
    if model.kind == "global":
        names = ("residual", "control") if control else ("sigma_t",)
        return Majorant({n: float(a[0, 0, 0]) for n, a in zip(names, arrays, strict=True)})
    numbers |= {f"n{axis}": n for axis, n in zip("xyz", cells, strict=True)}
    per_length = np.array(cells) / medium.extent
    numbers |= {f"cells_per_{axis}": c for axis, c in zip("xyz", per_length.tolist(), strict=True)}
    # The walk may step one cell too far where rounding puts a plane just inside the ray's end.
    padded = [np.pad(array, 1, mode="edge").astype(np.float32) for array in arrays]
    numbers["cells"] = padded[0].size
    return Majorant(numbers, np.stack(padded))


def _controls(
    medium: Medium, cells: tuple, lower: np.ndarray, upper: np.ndarray, control: Mapping[str, Any]
) -> np.ndarray:
    base = {
        "minorant": lambda: lower,
        "middle": lambda: (lower + upper) / 2,
        "mean": lambda: _means(medium, cells, lower, upper),
        "number": lambda: np.ones_like(lower),
    }[control["control"]]()
    return base * control["share"]


def _means(medium: Medium, cells: tuple, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The mean extinction of each cell [nz, ny, nx], from points inside; of the whole box exactly."""
    if tuple(cells) == (1, 1, 1):
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
