"""What a case should return, in float64."""

from __future__ import annotations

import hashlib

import numpy as np

from freepath.scene.cache import cached
from freepath.scene.media.base import Array, Index, Medium, Pieces
from freepath.scene.media.scaled import Scaled
from freepath.scene.special import NODES, WEIGHTS

VERSION = 1  # of the formulas below: a higher one makes cached references worthless
DEEPEST = 100.0  # exp(-100) = 4e-44: what lies beyond this depth does not change a sum
ROUNDS = 60  # halvings of a piece; it is then shorter than float64 distinguishes


def reference(estimand: str, medium: Medium, segments: Array) -> Array:
    """Return the exact value of an estimand for segments (N, 7), as (N,) or (N, channels) float64.

    transmittance: exp(-tau). free_path: the mean of min(X, length) over the free path X, a world
    length. mean_extinction: the mean over the medium's box, the same for every segment.
    """
    if len(medium.channels) > 1:
        each = [Scaled(medium, factor) for factor in medium.channels]
        return np.stack([reference(estimand, one, segments) for one in each], axis=1)
    if estimand == "mean_extinction":
        return np.full(len(segments), medium.mean())
    compute = {"transmittance": transmittance, "free_path": free_path}[estimand]
    digest = hashlib.sha256(f"{VERSION} {medium.fingerprint}".encode())
    digest.update(np.ascontiguousarray(segments).data)
    name = f"reference/{estimand}-{digest.hexdigest()}"
    return cached(name, lambda: compute(medium, segments))


def transmittance(medium: Medium, segments: Array) -> Array:
    """Return exp(-tau) along segments (N, 7), as (N,)."""
    return np.exp(-medium.optical_depth(segments))


def free_path(medium: Medium, segments: Array) -> Array:
    """Return the integral of the transmittance along segments (N, 7), as (N,) world lengths.

    This is the mean of min(X, length): the integral of the probability that X exceeds t. Each
    piece of a segment is halved until its optical depth is 1 at most; there the integrand is
    exp(-q), q smooth and between 0 and 1, and 16-point Gauss-Legendre quadrature is exact to
    rounding. The tests hold it against closed forms and adaptive quadrature to 1e-12, and show
    that halving the pieces once more changes nothing.
    """
    result = np.zeros(len(segments))
    for rows, pieces in medium.chunks(segments):
        result[rows] = _free_path(pieces)
    return result


def _free_path(pieces: Pieces, thickest: float = 1.0) -> Array:
    empty = np.where(pieces.depth == 0.0, pieces.length, 0.0)
    result = np.sum(empty * np.exp(-pieces.before), axis=1)
    segment, piece = np.nonzero((pieces.depth > 0.0) & (pieces.before < DEEPEST))
    # of each part of a piece: the fractions at which it starts and ends, the piece's depth there
    start, end = np.zeros(len(segment)), np.ones(len(segment))
    parts = np.array([start, end, start, pieces.depth[segment, piece]])
    for remaining in reversed(range(ROUNDS)):
        coarse = (parts[3] - parts[2] > thickest) & (remaining > 0)
        integral = _quadrature(pieces, segment[~coarse], piece[~coarse], *parts[:2, ~coarse])
        result += np.bincount(segment[~coarse], integral, minlength=len(result))
        if not coarse.any():
            break
        segment, piece, parts = _halve(pieces, segment[coarse], piece[coarse], parts[:, coarse])
    return result


def _halve(
    pieces: Pieces, segment: Index, piece: Index, parts: Array
) -> tuple[Index, Index, Array]:
    """Halve parts of pieces, and drop the halves that hardly anything reaches."""
    start, end, start_depth, end_depth = parts
    middle = (start + end) / 2.0
    middle_depth = pieces.partial(segment, piece, middle)
    first, second = (
        (start, middle, start_depth, middle_depth),
        (middle, end, middle_depth, end_depth),
    )
    segment, piece, parts = np.tile(segment, 2), np.tile(piece, 2), np.hstack([first, second])
    reached = pieces.before[segment, piece] + parts[2] < DEEPEST
    return segment[reached], piece[reached], parts[:, reached]


def _quadrature(pieces: Pieces, segment: Index, piece: Index, start: Array, end: Array) -> Array:
    """Integrate the transmittance between two fractions of pieces, (K,) world lengths."""
    before, width = pieces.before[segment, piece], end - start
    total = np.zeros(len(segment))
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        depth = pieces.partial(segment, piece, start + node * width)
        total += weight * np.exp(-(before + depth))
    return total * width * pieces.length[segment, piece]
