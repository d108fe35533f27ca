"""A medium whose extinction is that of another times a factor: one channel of a chromatic one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freepath.scene.media.base import Array, Index, Medium, Pieces


class Scaled(Medium):
    """The extinction of `medium`, in the same box, times `factor` (0 or more)."""

    def __init__(self, medium: Medium, factor: float):
        numbers = medium.numbers | {"factor": factor}
        super().__init__(medium.extent, numbers, medium.to_medium, medium.data)
        self.kernel, self.offers = medium.kernel, medium.offers
        self._medium, self._factor = medium, float(factor)

    def sigma_t(self, points: Array) -> Array:
        return self._factor * self._medium.sigma_t(points)

    def pieces(self, segments: Array) -> Pieces:
        pieces = self._medium.pieces(segments)

        def partial(segment: Index, piece: Index, fraction: Array) -> Array:
            return self._factor * pieces.partial(segment, piece, fraction)

        return Pieces(pieces.start, pieces.length, self._factor * pieces.depth, partial)

    @property
    def pieces_per_segment(self) -> int:
        return self._medium.pieces_per_segment

    def optical_depth(self, segments: Array) -> Array:
        """Return the integral along segments (N, 7), by the other medium's own way."""
        return self._factor * self._medium.optical_depth(segments)

    def distance(self, segments: Array, depth: Array) -> Array:
        """Return where segments (N, 7) reach an optical depth (N,), inf where they do not."""
        if self._factor == 0.0:
            return np.full(len(segments), np.inf)
        return self._medium.distance(segments, depth / self._factor)

    def bounds(self, cells: tuple[int, int, int]) -> tuple[Array, Array]:
        lower, upper = self._medium.bounds(cells)
        return self._factor * lower, self._factor * upper

    def mean(self) -> float:
        return self._factor * self._medium.mean()

    def _content(self) -> tuple[NDArray, ...]:
        return self._medium._content()
