"""What a kernel recorded of each sample."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from freepath.measure.runner import Round


class Samples:
    """Single samples, each array of the shape (rays, samples), and the round they came from.

    They are read from the record when they are first asked for: a check looks at few of them.
    """

    def __init__(self, one: Round, blocks: int, samples: int):
        self.round = one
        width = one.recorded.shape[-1]
        self._recorded = one.recorded.reshape(blocks, -1, samples, width)

    def _column(self, index: int) -> np.ndarray:
        """One number of each sample, (rays, blocks, samples)."""
        return np.moveaxis(self._recorded[..., index], 1, 0).astype(np.float64, order="C")

    def _flat(self, index: int) -> np.ndarray:
        column = self._column(index)
        return column.reshape(len(column), -1)

    # where each ended, what it weighed there, what it contributes to the mean
    t = cached_property(lambda self: self._flat(0))
    weight = cached_property(lambda self: self._flat(1))
    score = cached_property(lambda self: self._flat(4))
    escaped = cached_property(lambda self: self._flat(2) > 0)

    @cached_property
    def lookups(self) -> np.ndarray:
        """Of each; the record is a running count of each unit."""
        count = np.diff(self._column(3), axis=2, prepend=0.0)
        return count.reshape(len(count), -1)

    @cached_property
    def weights(self) -> np.ndarray:
        """Of each channel, (channels, rays, samples); `weight` is that of the first."""
        return np.array([self._flat(i) for i in (1, *range(5, self._recorded.shape[-1], 2))])

    @cached_property
    def scores(self) -> np.ndarray:
        """Of each channel, (channels, rays, samples); `score` is that of the first."""
        return np.array([self._flat(i) for i in range(4, self._recorded.shape[-1], 2)])
