"""Work cut so small that a driver which ends loops early ends none of ours, and proof that it did.

Every lane ends by taking the number of a unit that is not there. If fewer numbers were taken than
units and lanes together, some work-item was stopped before, and what it worked on is lost.
"""

from __future__ import annotations

import numpy as np
from freepath.device import DeviceInfo
from freepath.errors import DriverLimitError

SAMPLES_OF_A_UNIT = 1
"""No more on a device that limits loops: a lane works on a unit at least, and a single sample of
unbiased ray marching may take a tenth of what llvmpipe allows."""


def parts_of(samples: int, info: DeviceInfo) -> int:
    """Into how many units to cut so many samples of a ray: 1 where nothing limits loops."""
    if not info.loop_limit:
        return 1
    least = -(-samples // SAMPLES_OF_A_UNIT)
    return next(parts for parts in range(least, samples + 1) if samples % parts == 0)


def joined(recorded: np.ndarray, rays: int, parts: int) -> np.ndarray:
    """What `parts` units of a ray recorded, (blocks x parts x rays, samples, 5), as one unit's."""
    if parts == 1:
        return recorded
    samples = recorded.shape[1]
    by_part = np.moveaxis(recorded.reshape(-1, parts, rays, samples, 5), 1, 2).copy()
    # lookups are a running count of each unit
    lookups = by_part[..., -1, 3]
    by_part[..., 3] += (np.cumsum(lookups, axis=-1) - lookups)[..., None]
    return by_part.reshape(-1, parts * samples, 5)


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
