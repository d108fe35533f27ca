"""What media with a closed form of their optical depth have in common."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from freepath.scene.media.base import Array, Index, Medium, Pieces, partition
from freepath.scene.media.cells import edges

Size = tuple[float, float, float]


class ClosedForm(Medium):
    """A medium whose optical depth is a formula, cut into pieces only to integrate over it."""

    offers = frozenset({"closed_form"})

    @abstractmethod
    def optical_depth(self, segments: Array) -> Array:
        """Return the closed form of the integral of sigma_t along segments (N, 7)."""

    def _cuts(self, segments: Array) -> Array:
        """Return parameters (N, K) where segments are cut; none where sigma_t is one polynomial."""
        return np.zeros((len(segments), 0))

    @property
    def pieces_per_segment(self) -> int:
        upright = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]])
        return self._cuts(upright).shape[1] + 1

    def pieces(self, segments: Array) -> Pieces:
        start, length = partition(self._cuts(segments), segments[:, 6])

        def partial(segment: Index, piece: Index, fraction: Array) -> Array:
            part = segments[segment]
            part[:, :3] += start[segment, piece, None] * part[:, 3:6]
            part[:, 6] = fraction * length[segment, piece]
            return self.optical_depth(part)

        segment, piece = np.indices(start.shape).reshape(2, -1)
        depth = partial(segment, piece, np.ones(start.size)).reshape(start.shape)
        return Pieces(start, length, depth, partial)


class HeightMedium(ClosedForm):
    """A closed form in the height alone."""

    @abstractmethod
    def _height_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return smallest and largest sigma_t between heights (N,) and (N,), exactly."""

    def bounds(self, cells: tuple[int, int, int]) -> tuple[Array, Array]:
        nx, ny, nz = cells
        heights = edges(self.extent[2], nz)
        pair = self._height_bounds(heights[:-1], heights[1:])
        return tuple(np.tile(bound[:, None, None], (1, ny, nx)) for bound in pair)

    def mean(self) -> float:
        """Return the mean over the box, which is the mean along any upright line through it."""
        upright = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, self.extent[2]]])
        return float(self.optical_depth(upright)[0] / self.extent[2])
