"""What variances and costs should be, in float64, by integrals along rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freepath.scene import Medium
from freepath.scene.media.base import Pieces

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
