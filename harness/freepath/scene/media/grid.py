"""Voxel grids: nearest or trilinear lookup, exact optical depth, bounds over coarser cells."""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from freepath.errors import VolumeError
from freepath.scene.media.base import Array, Index, Medium, Pieces, crossings, partition
from freepath.scene.media.cells import over_ranges, supporting_voxels

AXES = (0, 1, 2)
LARGEST_HALF = float(np.finfo(np.float16).max)


class GridMedium(Medium):
    """Extinction on voxels. numbers: nx, ny, nz. data: sigma_t in C order, z slowest, x fastest.

    Medium coordinates count voxels: voxel (i, j, k) covers [i, i + 1] x [j, j + 1] x [k, k + 1]
    and its value holds at its centre. `nearest` takes the value of the voxel that a point is in;
    `trilinear` interpolates between the eight centres around it, and is constant beyond the
    outermost centres (clamp to edge). `voxels` is float32 [z, y, x], already scaled; it is the
    truth for references, and for kernels that read it as float. For `trilinear` an axis of one
    voxel becomes one of two half as long, so that every point lies between two centres. `name` is
    what messages call it, `first` the index [z, y, x] that they give its first voxel.
    """

    offers = frozenset({"cells"})

    def __init__(
        self,
        voxels: NDArray[np.float32],
        to_medium: Array,
        interpolation: str,
        name: str = "grid",
        first: tuple[int, int, int] = (0, 0, 0),
    ):
        to_medium = np.array(to_medium, dtype=np.float64)
        self._trilinear = interpolation == "trilinear"
        self._name, self._first, self._copies = name, first, 1
        for axis in AXES:
            if self._trilinear and voxels.shape[2 - axis] == 1:
                voxels = np.repeat(voxels, 2, axis=2 - axis)
                to_medium[axis] *= 2.0
                self._copies *= 2
        self.voxels = np.ascontiguousarray(voxels, dtype=np.float32)
        self.kernel = f"grid_{interpolation}"
        self._shape = self.voxels.shape[::-1]
        self._strides = (1, self._shape[0], self._shape[0] * self._shape[1])
        numbers = dict(zip(("nx", "ny", "nz"), self._shape, strict=True))
        super().__init__(self._shape, numbers, to_medium, self.voxels.reshape(-1))

    def stored(self, storage: str) -> Medium:
        """Return the same grid with each voxel rounded to what is stored of it: float or half.

        Its `data` are float16 then. Raises VolumeError with the first voxel that is too large for
        half, [z, y, x] as the file counts, its value and the count of them.
        """
        if storage == "float":
            return self
        with np.errstate(over="ignore", under="ignore"):
            halves = self.voxels.astype(np.float16)
        self._refuse_infinite(halves)
        interpolation = "trilinear" if self._trilinear else "nearest"
        rounded = GridMedium(halves, self.to_medium, interpolation, self._name, self._first)
        rounded.channels, rounded.data = self.channels, halves.reshape(-1)
        return rounded

    def _refuse_infinite(self, halves: NDArray[np.float16]) -> None:
        wrong = np.isinf(halves)
        if not wrong.any():
            return
        # of the two that stand for one voxel, the first has that voxel's index
        found = np.argwhere(wrong)[0]
        at = [start + int(i) for start, i in zip(self._first, found, strict=True)]
        largest = float(self.voxels.max())
        units = 2.0 ** np.ceil(np.log2(largest / LARGEST_HALF))
        raise VolumeError(
            f"{self._name}: {int(wrong.sum()) // self._copies} voxels are too large for storage "
            f"half, which ends at {LARGEST_HALF:g} (first [z, y, x] = {at}: extinction "
            f"{self.voxels[tuple(found)]:g}, largest {largest:g}): use storage float, or a unit of "
            f"length {units:g} times as long (sigma_t / {units:g}, lengths x {units:g})"
        )

    def sigma_t(self, points: Array) -> Array:
        """Return the extinction at points (N, 3) in voxel units, as (N,) float64."""
        position = np.asarray(points, dtype=np.float64).T
        if not self._trilinear:
            return self._nearest(position)
        first, base = self._dual_cell(position)
        local = [np.clip(position[a] - 0.5 - first[a], 0.0, 1.0) for a in AXES]
        return self._interpolate(base, [[part] for part in local])[0, 0, 0]

    def _nearest(self, position: Array) -> Array:
        voxel = [np.clip(position[a].astype(np.intp), 0, self._shape[a] - 1) for a in AXES]
        return self.data[sum(voxel[a] * self._strides[a] for a in AXES)].astype(np.float64)

    def _dual_cell(self, position: Array) -> tuple[list[Index], Index]:
        """Return the voxel below each position (3, N) on each axis, and its place in the data.

        Its neighbour above is part of the dual cell too, so that the last voxel is never `below`.
        """
        first = [
            np.clip(np.floor(position[a] - 0.5).astype(np.intp), 0, self._shape[a] - 2)
            for a in AXES
        ]
        return first, sum(first[a] * self._strides[a] for a in AXES)

    def _interpolate(self, base: Index, local: list[list[Array]]) -> Array:
        """Interpolate at every combination of local coordinates, as (z's, y's, x's, N).

        `local` holds for x, y and z a list of coordinates in [0, 1] in the dual cells at `base`.
        """
        x, y, z = (np.array([0, stride]) for stride in self._strides)
        corners = z[:, None, None, None] + y[:, None, None] + x[:, None]
        values = self.data[base + corners].astype(np.float64)
        for axis in AXES:
            place = 2 - axis
            low, high = np.moveaxis(values, place, 0)
            # a convex combination, not low + t (high - low): it keeps the digits of a small value
            # beside a large one, and never leaves the range of the two
            values = np.stack([(1.0 - t) * low + t * high for t in local[axis]], axis=place)
        return values

    @property
    def pieces_per_segment(self) -> int:
        """Width of the arrays that `pieces` returns: planes of all axes plus one."""
        return sum(len(self._planes(axis)) for axis in AXES) + 1

    def _planes(self, axis: int) -> Array:
        count = self._shape[axis]
        return np.arange(count) + 0.5 if self._trilinear else np.arange(1.0, count)

    def pieces(self, segments: Array) -> Pieces:
        """Cut segments (N, 7) at every plane on which the interpolation has a kink.

        These are the faces of the voxels (nearest) or of the dual cells between their centres
        (trilinear, where sigma_t is a cubic along a ray inside a dual cell).
        """
        cuts = [
            crossings(segments[:, a], segments[:, 3 + a], self._planes(a), segments[:, 6])
            for a in AXES
        ]
        start, length = partition(np.concatenate(cuts, axis=1), segments[:, 6])
        segment, piece = np.nonzero(length > 0.0)
        slot = np.zeros(length.shape, dtype=np.intp)
        slot[segment, piece] = np.arange(len(segment))
        control = self._control(segments[segment], start[segment, piece], length[segment, piece])
        # The integral of a polynomial in Bernstein form has the running sums of its control points
        # as its own (Farouki and Rajan 1988, Algorithms for polynomials in Bernstein form). None is
        # negative, so that no digits cancel; the last one is the mean of sigma_t on the piece.
        integral = np.cumsum(control, axis=0) / len(control)
        depth = np.zeros(length.shape)
        depth[segment, piece] = length[segment, piece] * integral[-1]

        def partial(segment: Index, piece: Index, fraction: Array) -> Array:
            chosen = integral[:, slot[segment, piece]]
            return length[segment, piece] * bernstein(chosen, fraction)

        return Pieces(start, length, depth, partial)

    def _control(self, segments: Array, start: Array, length: Array) -> Array:
        """Return the Bernstein coefficients of sigma_t along pieces of rays, (1 or 4, N)."""
        middle = segments[:, :3] + (start + length / 2.0)[:, None] * segments[:, 3:6]
        if not self._trilinear:
            return self._nearest(middle.T)[None]
        first, base = self._dual_cell(middle.T)
        local = []
        for a in AXES:
            ends = [segments[:, a] + t * segments[:, 3 + a] for t in (start, start + length)]
            local.append([np.clip(end - 0.5 - first[a], 0.0, 1.0) for end in ends])
        # The blossom of the trilinear function: the corners of the box that the piece spans,
        # averaged over those with equally many coordinates taken at the piece's end.
        c = self._interpolate(base, local)
        one = (c[0, 0, 1] + c[0, 1, 0] + c[1, 0, 0]) / 3.0
        two = (c[0, 1, 1] + c[1, 0, 1] + c[1, 1, 0]) / 3.0
        return np.stack([c[0, 0, 0], one, two, c[1, 1, 1]])

    def bounds(self, cells: tuple[int, int, int]) -> tuple[Array, Array]:
        """Return minorant and majorant over (nx, ny, nz) equal cells, each as [nz, ny, nx].

        The extremes of all voxels that a lookup in the closed cell gives a weight to.
        """
        results = []
        for extreme in (np.minimum, np.maximum):
            array = self.voxels
            for axis, count in enumerate(cells):
                first, last = supporting_voxels(self._shape[axis], count, self._trilinear)
                array = over_ranges(array, extreme, first, last, 2 - axis)
            results.append(array.astype(np.float64))
        return tuple(results)

    def mean(self) -> float:
        """Return the mean over the box, which is the voxels' own mean for both interpolations.

        A trilinear weight function integrates to 1 over the box also at its edge, where half of
        the hat is replaced by a constant 1 of half a voxel.
        """
        return float(self.voxels.mean(dtype=np.float64))


def bernstein(control: Array, fraction: Array) -> Array:
    """Evaluate polynomials that are 0 at 0, from control points 1 to n (n, N), at `fraction` (N,).

    That is the sum over j of binomial(n, j) f^j (1 - f)^(n - j) control[j - 1].
    """
    degree, rest = len(control), 1.0 - fraction
    result, power = np.zeros_like(fraction), np.ones_like(fraction)
    for order, point in enumerate(control, start=1):
        power = power * fraction
        result = result * rest + comb(degree, order) * power * point
    return result
