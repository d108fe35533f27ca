"""What variances and costs should be, in float64, by integrals along rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freepath.config.base import Kind
from freepath.scene import Medium
from freepath.scene.media.base import Pieces, crossings, partition
from freepath.scene.references import free_path
from freepath.scene.special import NODES, WEIGHTS

Array = NDArray[np.float64]


def cut(segments: Array, lengths: Array) -> Array:
    """Segments with other lengths."""
    return np.column_stack([segments[:, :6], lengths])


def depth_at(medium: Medium, segments: Array, t: Array) -> Array:
    """Optical depth at distances t (rays, samples).

    Each ray is cut into pieces once, not once for each of its samples.
    """
    depth = np.empty(t.shape)
    for rows, pieces in medium.chunks(segments):
        depth[rows] = _depth_in(pieces, t[rows])
    # what a wrong kernel returns may lie before a ray or behind it, where it has no pieces
    ray, sample = np.nonzero(~((t >= 0.0) & (t <= segments[:, 6:])))
    depth[ray, sample] = medium.optical_depth(cut(segments[ray], t[ray, sample]))
    return depth


def _depth_in(pieces: Pieces, t: Array) -> Array:
    """Optical depth at distances t (rays, samples) of the rays that the pieces are of."""
    found = [np.searchsorted(one, at, "right") for one, at in zip(pieces.start, t, strict=True)]
    piece = np.maximum(np.array(found).reshape(t.shape) - 1, 0)
    segment = np.broadcast_to(np.arange(len(t))[:, None], t.shape)
    length = pieces.length[segment, piece]
    along = np.divide(
        t - pieces.start[segment, piece], length, where=length > 0.0, out=np.zeros(t.shape)
    )
    within = pieces.partial(segment.ravel(), piece.ravel(), np.clip(along, 0.0, 1.0).ravel())
    return pieces.before[segment, piece] + within.reshape(t.shape)


class MajorantAlongRays:
    """A majorant, constant in each of its cells, along segments (rays, 7)."""

    def __init__(self, model: Kind, medium: Medium, tightness: float, segments: Array):
        self._medium = medium
        self._segments = segments
        self._cells = np.array((1, 1, 1) if model.kind == "global" else model.resolution)
        self._upper = medium.bounds(tuple(self._cells))[1] * tightness

    def _cuts(self) -> Array:
        """Where the rays cross from one cell to the next."""
        cuts = []
        for axis, count in enumerate(self._cells):
            planes = self._medium.extent[axis] * np.arange(1, count) / count
            position, direction = self._segments[:, axis], self._segments[:, 3 + axis]
            cuts.append(crossings(position, direction, planes, self._segments[:, 6]))
        return np.concatenate(cuts, axis=1)

    def planes(self) -> int:
        """How many planes between cells all rays cross together."""
        cuts, ends = self._cuts(), self._segments[:, 6:]
        return int(np.count_nonzero((cuts > 0.0) & (cuts < ends)))

    def points(self, t: Array) -> Array:
        """The places at distances t (rays, samples)."""
        return self._segments[:, None, :3] + t[..., None] * self._segments[:, None, 3:6]

    def at(self, points: Array, values: Array | None = None) -> Array:
        """The majorant there, or other values of its cells."""
        share = points / self._medium.extent * self._cells
        i, j, k = np.moveaxis(np.clip(share.astype(int), 0, self._cells - 1), -1, 0)
        return (self._upper if values is None else values)[k, j, i]

    def tentative_collisions(self) -> Array:
        """The integral of the majorant: of a path that none of them stops."""
        start, length = partition(self._cuts(), self._segments[:, 6])
        return (self.at(self.points(start + length / 2.0)) * length).sum(axis=1)

    def collisions_until_real(self) -> Array:
        """The integral of majorant x transmittance: of a path that ends at a real collision."""
        start, length = partition(self._cuts(), self._segments[:, 6])
        majorant = self.at(self.points(start + length / 2.0))
        ends = np.column_stack([start, self._segments[:, 6]])
        flown = [free_path(self._medium, cut(self._segments, end)) for end in ends.T]
        return (majorant * np.diff(np.column_stack(flown), axis=1)).sum(axis=1)

    def square_over_majorant(self) -> Array:
        """The integral of sigma_t^2 / majorant, by quadrature on pieces where both are smooth."""
        kinks = self._medium.pieces(self._segments).start
        cuts = np.concatenate([self._cuts(), kinks], axis=1)
        start, length = partition(cuts, self._segments[:, 6])
        majorant = self.at(self.points(start + length / 2.0))
        total = np.zeros(len(self._segments))
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            points = self.points(start + node * length)
            sigma = self._medium.sigma_t(points.reshape(-1, 3)).reshape(start.shape)
            share = np.divide(sigma**2, majorant, where=majorant > 0.0, out=np.zeros_like(sigma))
            total += weight * (share * length).sum(axis=1)
        return total
