"""What every medium answers, and what follows from it: depth, distance, fingerprint."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

CELLS_PER_CHUNK = 1 << 18  # pieces worked on at a time: keeps the intermediate arrays small


@dataclass(frozen=True)
class Pieces:
    """Segments cut where sigma_t has a kink, or finely enough for it to be smooth on each piece.

    `start` and `length` (world units along the segment) and `depth` (optical depth) have the
    shape (segments, pieces); pieces of length 0 fill the rows. `partial(segment, piece, fraction)`
    takes three equally long arrays and gives the depth of the first `fraction` of those pieces.
    On a piece sigma_t is a polynomial of degree three at most, or varies by its own scale once.
    """

    start: Array
    length: Array
    depth: Array
    partial: Callable[[Index, Index, Array], Array]

    @cached_property
    def before(self) -> Array:
        """Optical depth from the start of the segment to the start of each piece."""
        return np.cumsum(self.depth, axis=1) - self.depth


class Medium(ABC):
    """Extinction in a box, in float64: the truth that the kernels are measured against.

    Points and segments are in medium coordinates, where the box is [0, extent] whatever the
    transform `to_medium` (3, 4) from the world does. Segments are rows of seven: entry point,
    direction per unit of world length, length in the world. Extinction is per unit of world
    length.

    `channels` (C,) are the extinctions of the channels relative to sigma_t, which is that of none
    of them where there are several; (1,) of a grey medium.
    """

    channels: Array = np.ones(1)
    told: str = ""
    """What of which file it is."""
    kernel: str
    offers: frozenset[str]

    def __init__(
        self,
        extent: tuple[float, float, float] | Array,
        numbers: dict[str, float],
        to_medium: Array | None = None,
        data: NDArray[np.float32] | None = None,
    ):
        self.extent = np.asarray(extent, dtype=np.float64)
        self.numbers = {name: float(value) for name, value in numbers.items()}
        self.to_medium = np.eye(3, 4) if to_medium is None else np.asarray(to_medium, np.float64)
        self.data = data

    @abstractmethod
    def sigma_t(self, points: Array) -> Array:
        """Return the extinction at points (N, 3) of the box, as (N,)."""

    @abstractmethod
    def pieces(self, segments: Array) -> Pieces:
        """Cut segments (N, 7) into pieces on which sigma_t is smooth."""

    @property
    @abstractmethod
    def pieces_per_segment(self) -> int:
        """Width of the arrays that `pieces` returns."""

    @abstractmethod
    def bounds(self, cells: tuple[int, int, int]) -> tuple[Array, Array]:
        """Return minorant and majorant over (nx, ny, nz) equal cells, each as [nz, ny, nx]."""

    @abstractmethod
    def mean(self) -> float:
        """Return the mean extinction over the box."""

    def stored(self, storage: str) -> Medium:
        """Return the medium as kernels read it where voxels are stored so; without voxels itself.

        Raises VolumeError where an extinction cannot be stored so.
        """
        return self

    def chunks(self, segments: Array) -> Iterator[tuple[slice, Pieces]]:
        """Cut many segments into pieces, a few rows at a time."""
        step = max(1, CELLS_PER_CHUNK // self.pieces_per_segment)
        for first in range(0, len(segments), step):
            rows = slice(first, min(first + step, len(segments)))
            yield rows, self.pieces(segments[rows])

    def optical_depth(self, segments: Array) -> Array:
        """Return the exact integral of sigma_t along segments (N, 7), as (N,)."""
        depth = np.zeros(len(segments))
        for rows, pieces in self.chunks(segments):
            depth[rows] = pieces.depth.sum(axis=1)
        return depth

    def distance(self, segments: Array, depth: Array) -> Array:
        """Return the world length t at which segments (N, 7) first exceed an optical depth (N,).

        t = inf{t: tau(t) > depth}, the right-continuous inverse: a depth of 0 gives the start of
        the medium, not a point of the vacuum before it. inf where the segment's depth does not
        exceed it, so that an empty segment is never hit.
        """
        result = np.full(len(segments), np.inf)
        for rows, pieces in self.chunks(segments):
            result[rows] = self._invert(segments[rows], pieces, depth[rows])
        # the running sum of the pieces may differ from the depth in its last bit: the depth decides
        inside = depth < self.optical_depth(segments)
        return np.where(inside, np.minimum(result, segments[:, 6]), np.inf)

    def _invert(self, segments: Array, pieces: Pieces, depth: Array) -> Array:
        reached = np.cumsum(pieces.depth, axis=1) > depth[:, None]
        segment = np.flatnonzero(reached.any(axis=1))
        piece = reached[segment].argmax(axis=1)
        rest = np.maximum(depth[segment] - pieces.before[segment, piece], 0.0)
        fraction = self._solve(segments, pieces, segment, piece, rest)
        result = np.full(len(segments), np.inf)
        offset = fraction * pieces.length[segment, piece]
        result[segment] = pieces.start[segment, piece] + offset
        return result

    def _solve(
        self, segments: Array, pieces: Pieces, segment: Index, piece: Index, rest: Array
    ) -> Array:
        """Find the fraction of each piece at which its depth is `rest`: Newton in a bracket."""
        total, length = pieces.depth[segment, piece], pieces.length[segment, piece]
        lower, upper = np.zeros_like(rest), np.ones_like(rest)
        fraction = rest / total
        for _ in range(100):
            error = pieces.partial(segment, piece, fraction) - rest
            if np.all((np.abs(error) <= 4e-16 * rest) | (upper - lower <= 1e-17)):
                break
            upper = np.where(error > 0.0, fraction, upper)
            lower = np.where(error > 0.0, lower, fraction)
            at = pieces.start[segment, piece] + fraction * length
            points = segments[segment, :3] + at[:, None] * segments[segment, 3:6]
            with np.errstate(divide="ignore", invalid="ignore"):
                newton = fraction - error / (self.sigma_t(points) * length)
            inside = (newton > lower) & (newton < upper)
            fraction = np.where(inside, newton, (lower + upper) / 2.0)
        return fraction

    def world_box(self) -> Array:
        """Return the eight corners of the box in world coordinates, as (8, 3), x fastest."""
        corner = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)])
        to_world = np.linalg.inv(self.to_medium[:, :3])
        return (corner * self.extent - self.to_medium[:, 3]) @ to_world.T

    @cached_property
    def fingerprint(self) -> str:
        """Sha256, in hexadecimal, over everything that defines the medium."""
        digest = hashlib.sha256(f"{self.kernel} {sorted(self.numbers.items())!r}".encode())
        digest.update(self.extent.tobytes() + self.to_medium.tobytes())
        for array in self._content():
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()

    def _content(self) -> tuple[NDArray, ...]:
        """Return the arrays that define the medium beside its numbers."""
        return () if self.data is None else (self.data,)


def crossings(position: Array, direction: Array, planes: Array, length: Array) -> Array:
    """Return where rays cross planes of one coordinate, as (N, planes), clipped to [0, length].

    `position`, `direction` and `length` are (N,). Rays parallel to the planes cross none (0).
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        parameter = (planes - position[:, None]) / direction[:, None]
    parameter[direction == 0.0] = 0.0
    return np.clip(parameter, 0.0, length[:, None], out=parameter)


def partition(parameters: Array, length: Array) -> tuple[Array, Array]:
    """Return start and length of the pieces between parameters (N, K), as two (N, K + 1)."""
    borders = np.concatenate([np.zeros((len(length), 1)), parameters, length[:, None]], axis=1)
    borders.sort(axis=1)
    return borders[:, :-1], np.diff(borders, axis=1)
