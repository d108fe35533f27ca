"""The leaves of an octree over a cube of cells, from the pyramid of their majorants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def leaf_sizes(majorants: np.ndarray, slack: float) -> np.ndarray:
    """Join cells into leaves; returns each cell's leaf's side in cells, a power of two.

    `majorants` is [n, n, n], n a power of two. From the bottom up, eight leaves of one size become
    one if the majorant of their union, over their volume, is at most 1 + slack times the sum of
    theirs: what a leaf saves in crossings it then costs at most in tentative collisions.
    """
    sizes = np.ones(majorants.shape, np.int32)
    upper = majorants
    size = 1
    whole = np.ones(majorants.shape, bool)
    while upper.shape[0] > 1:
        joined = _blocks(upper, 2).max(axis=(1, 3, 5))
        apart = _blocks(upper, 2).sum(axis=(1, 3, 5))
        whole = _blocks(whole, 2).all(axis=(1, 3, 5)) & (8 * joined <= (1 + slack) * apart)
        size *= 2
        sizes[_spread(whole, size)] = size
        upper = joined
    return sizes


def over_leaves(
    values: np.ndarray, sizes: np.ndarray, reduce: Callable[..., np.ndarray]
) -> np.ndarray:
    """Give each cell the reduction (np.min, np.max, np.mean) of the values in its leaf."""
    result = values.copy()
    size = 2
    while size <= values.shape[0]:
        reduced = _spread(reduce(_blocks(values, size), axis=(1, 3, 5)), size)
        result = np.where(sizes == size, reduced, result)
        size *= 2
    return result


def _blocks(array: np.ndarray, size: int) -> np.ndarray:
    """View a cube as [n / size, size] along each axis."""
    n = array.shape[0] // size
    return array.reshape(n, size, n, size, n, size)


def _spread(array: np.ndarray, size: int) -> np.ndarray:
    """Repeat each element along all axes."""
    return array.repeat(size, 0).repeat(size, 1).repeat(size, 2)
