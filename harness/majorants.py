"""Majorants of a medium: one for all of it, or one for each cell of a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

NUMBERS = {
    "global": ("sigma_t",),
    "grid": ("nx", "ny", "nz", "cells_per_x", "cells_per_y", "cells_per_z"),
}
"""What a kernel reads of each kind of majorant, beside its data."""


@dataclass(frozen=True)
class Majorant:
    """What a kernel reads of a majorant: its numbers by name, and a padded grid or None."""

    numbers: dict[str, float]
    data: np.ndarray | None = None


def cells_of(model: Any) -> tuple[int, int, int]:
    """The cells (nx, ny, nz) over which a config's majorant bounds the medium."""
    return model.resolution if model.kind == "grid" else (1, 1, 1)


def build(model: Any, upper: np.ndarray, extent: np.ndarray, tightness: float) -> Majorant:
    """Make a majorant from the medium's upper bounds [nz, ny, nx] over its cells (1/world length).

    `extent` is the size of the box in medium coordinates.
    """
    if model.kind == "global":
        return Majorant({"sigma_t": float(upper[0, 0, 0]) * tightness})
    counts = [float(count) for count in model.resolution]
    per_length = (np.array(counts) / extent).tolist()
    numbers = dict(zip(NUMBERS["grid"], [*counts, *per_length], strict=True))
    # The walk may step one cell too far where rounding puts a plane just inside the ray's end.
    padded = np.pad(upper * tightness, 1, mode="edge").astype(np.float32)
    return Majorant(numbers, padded)
