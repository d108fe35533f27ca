"""Work made so small that a device of which little can be asked gets through it.

An interpreter is slow: it gets few rays and few samples. A driver that ends loops early gets units
so small that it ends none of ours, and what it did is proven to be all: every lane ends by taking
the number of a unit that is not there, so if fewer numbers were taken than units and lanes
together, some work-item was stopped before, and what it worked on is lost.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from freepath.device.opencl import DeviceInfo
from freepath.errors import DriverLimitError, UsageError
from freepath.scene import Medium

INTERPRETED_RAYS, INTERPRETED_SAMPLES = 16, 4
"""The most rays, and samples of each, that a device gets which interprets kernels to check them."""
SAMPLES_OF_A_UNIT = 1
"""No more on a device that limits loops: a lane works on a unit at least, and eight samples of
unbiased ray marching were too many for llvmpipe."""

LENGTHS, EXTINCTIONS, SQUARED = (1e-30, 1e22), (1e-30, 1e30), (1e-15, 1e15)
"""What kernels count in float32, and what they count whose squares they count as well;
docs/notation.md derives it."""


def check_units(case: Any, medium: Medium, largest: float) -> None:
    """Refuse a scene in units in which float32 cannot hold its lengths and extinctions.

    `largest` is the medium's largest sigma_t.
    """
    length = float(np.linalg.norm(np.ptp(medium.world_box(), axis=0)))
    majorant = largest * float(medium.channels.max()) * (case.tightness or 1.0)
    near = any(getattr(case.light, "intensity", ()))
    lengths = SQUARED if near or case.estimand in ("free_path", "path_length") else LENGTHS
    extinctions = SQUARED if case.estimand == "mean_extinction" else EXTINCTIONS
    for what, value, (low, high) in (
        ("the diagonal of its box", length, lengths),
        ("its largest majorant", majorant or extinctions[0], extinctions),
        ("the optical depth of its box", majorant * length, (0.0, LENGTHS[1])),
    ):
        if not low <= value <= high:
            raise UsageError(
                f"{case.name}: {what} is {value:.4g}, expected {low:g} to {high:g}, which float32 "
                "holds: choose another unit of length"
            )


def rays_of(segments: np.ndarray, info: DeviceInfo) -> np.ndarray:
    """The segments (rays, 7) that a device gets: all, or of an interpreter few, evenly chosen."""
    if not info.interpreted or len(segments) <= INTERPRETED_RAYS:
        return segments
    chosen = np.linspace(0, len(segments) - 1, INTERPRETED_RAYS).round().astype(int)
    return segments[chosen]


def samples_of(samples: int | None, info: DeviceInfo) -> int | None:
    """How many samples of each ray a case takes, None if as many as precision asks for."""
    if not info.interpreted:
        return samples
    return min(samples or INTERPRETED_SAMPLES, INTERPRETED_SAMPLES)


def parts_of(samples: int, info: DeviceInfo) -> int:
    """Into how many units to cut N samples of a ray: 1 where nothing limits loops."""
    if not info.loop_limit:
        return 1
    least = -(-samples // SAMPLES_OF_A_UNIT)
    return next(parts for parts in range(least, samples + 1) if samples % parts == 0)


def joined(recorded: np.ndarray, rays: int, parts: int) -> np.ndarray:
    """What `parts` units of a ray recorded, (blocks x parts x rays, samples, n), as one unit's."""
    if parts == 1:
        return recorded
    samples, width = recorded.shape[1:]
    by_part = np.moveaxis(recorded.reshape(-1, parts, rays, samples, width), 1, 2).copy()
    # lookups are a running count of each unit
    lookups = by_part[..., -1, 3]
    by_part[..., 3] += (np.cumsum(lookups, axis=-1) - lookups)[..., None]
    return by_part.reshape(-1, parts * samples, width)


def check(taken: int, end: int, lanes: int, units: int, info: DeviceInfo) -> bool:
    """Tell whether a launch came to its end; False where one of fewer units may.

    Raises DriverLimitError where it had a unit a lane and cannot be smaller.
    """
    if taken >= end + lanes:
        return True
    if units <= lanes:
        limit = f"after {info.loop_limit} rounds" if info.loop_limit else "before they are done"
        raise DriverLimitError(
            f"{info.label}: the driver ends loops {limit}, and paths of this case need more"
        )
    return False
