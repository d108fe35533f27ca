"""Equal cells of a box, and the smallest and largest of an array over ranges of its elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def edges(extent: float, count: int) -> Array:
    """Return the count + 1 edges of equal cells over [0, extent].

    Each is extent * i / count, rounded once, so that a cell which ends where a layer ends does so
    in floating point too.
    """
    return extent * np.arange(count + 1) / count


def supporting_voxels(voxels: int, count: int, trilinear: bool) -> tuple[Index, Index]:
    """Return the first and the last voxel that a lookup inside each of `count` cells can touch.

    The `voxels` voxels of one axis are cut into `count` equal cells. Nearest: voxel i covers
    [i, i + 1]. Trilinear: it has a weight over the open interval (i - 1/2, i + 3/2), which gives
    cells that end on voxel faces a halo of one voxel. Integers throughout: no rounding may lose
    a voxel.
    """
    cell = np.arange(count, dtype=np.int64)
    lower, upper = 2 * cell * voxels, 2 * (cell + 1) * voxels  # in units of 1 / (2 count) voxel
    halo = count if trilinear else 0
    unit = 2 * count
    first = (lower - halo - unit) // unit + 1 if trilinear else lower // unit
    last = -(-(upper + halo) // unit) - 1
    return np.clip(first, 0, voxels - 1), np.clip(last, 0, voxels - 1)


def over_ranges(array: NDArray, extreme: np.ufunc, first: Index, last: Index, axis: int) -> NDArray:
    """Return the `extreme` (np.minimum or np.maximum) of array[first[i]..last[i]] along one axis.

    One range for every i, both ends included; ranges may overlap.
    """
    result = np.take(array, first, axis=axis)
    for offset in range(1, int(np.max(last - first)) + 1):
        # a range that is shorter than the longest repeats its last element
        element = np.take(array, np.minimum(first + offset, last), axis=axis)
        extreme(result, element, out=result)
    return result
