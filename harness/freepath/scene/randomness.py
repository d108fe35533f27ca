"""Random numbers that are the same on every machine and with every version of numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def uniforms(seed: int, purpose: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return uniform numbers in [0, 1), an independent stream for each seed and purpose.

    The raw output of PCG64 is fixed by numpy's policy (NEP 19); the methods of Generator are not.
    """
    raw = np.random.PCG64([seed % 2**64, purpose]).random_raw(int(np.prod(shape)))
    return ((raw >> np.uint64(11)) * 2.0**-53).reshape(shape)
