"""Majorants of a medium: one for all of it, or one for each cell of a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from freepath.scene import Medium


@dataclass(frozen=True)
class Majorant:
    """What a kernel reads of a majorant: `kernel` names its file, `data` is a padded grid or None."""

    kernel: str
    numbers: dict[str, float]
    data: np.ndarray | None = None


def build(model: Any, medium: Medium, tightness: float) -> Majorant:
    """Bound the medium as the config's majorant says, times tightness (1/world length)."""
    if model.kind == "global":
        _, upper = medium.bounds((1, 1, 1))
        return Majorant("global", {"sigma_t": float(upper[0, 0, 0]) * tightness})
    cells = model.resolution
    _, upper = medium.bounds(cells)
    numbers: dict[str, float] = {f"n{axis}": n for axis, n in zip("xyz", cells, strict=True)}
    per_length = np.array(cells) / medium.extent
    numbers |= {f"cells_per_{axis}": c for axis, c in zip("xyz", per_length.tolist(), strict=True)}
    # The walk may step one cell too far where rounding puts a plane just inside the ray's end.
    padded = np.pad(upper * tightness, 1, mode="edge").astype(np.float32)
    return Majorant("grid", numbers, padded)
