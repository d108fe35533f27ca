"""The Gaussian blob, the one closed form that varies with more than the height."""

from __future__ import annotations

import numpy as np

from freepath.scene import special
from freepath.scene.media.base import Array
from freepath.scene.media.cells import edges
from freepath.scene.media.closed_form import ClosedForm, Size


class Gaussian(ClosedForm):
    """sigma_t(p) = peak exp(-|p - center|^2 inverse_width^2 / 2).

    numbers: peak, inverse_width (1 / standard deviation), center_x, center_y, center_z.
    """

    kernel = "gaussian"

    def __init__(self, peak: float, width: float, center: Size | None, size: Size):
        self._width = float(width)
        self._center = np.asarray(size) / 2.0 if center is None else np.asarray(center, float)
        numbers = {"peak": peak, "inverse_width": 1.0 / width}
        numbers |= dict(zip(("center_x", "center_y", "center_z"), self._center, strict=True))
        super().__init__(size, numbers)

    def _at_square(self, square: Array) -> Array:
        return self.numbers["peak"] * np.exp(-square / (2.0 * self._width**2))

    def sigma_t(self, points: Array) -> Array:
        return self._at_square(np.sum((points - self._center) ** 2, axis=1))

    def _nearest(self, segments: Array) -> tuple[Array, Array]:
        """Return the speed |d| of each ray and the parameter at which it is next to the center."""
        direction = segments[:, 3:6]
        square = np.sum(direction**2, axis=1)
        offset = np.sum((self._center - segments[:, :3]) * direction, axis=1)
        return np.sqrt(square), offset / square

    def optical_depth(self, segments: Array) -> Array:
        """Return the extinction next to the center times an integral of exp(-x^2) along the ray."""
        speed, nearest = self._nearest(segments)
        miss = segments[:, :3] + nearest[:, None] * segments[:, 3:6] - self._center
        scale = speed / (np.sqrt(2.0) * self._width)
        along = special.gauss_integral(-nearest * scale, segments[:, 6] * scale) / scale
        return self._at_square(np.sum(miss**2, axis=1)) * along

    def _cuts(self, segments: Array) -> Array:
        speed, nearest = self._nearest(segments)
        widths = np.arange(-38.0, 39.0) * self._width  # at 38 widths exp(-x^2 / 2) is 0
        cuts = nearest[:, None] + widths / speed[:, None]
        return np.clip(cuts, 0.0, segments[:, 6, None])

    def bounds(self, cells: tuple[int, int, int]) -> tuple[Array, Array]:
        nearest, farthest = 0.0, 0.0
        for axis, count in enumerate(cells):
            offset = edges(self.extent[axis], count) - self._center[axis]
            inside = np.clip(0.0, offset[:-1], offset[1:])
            outside = np.maximum(np.abs(offset[:-1]), np.abs(offset[1:]))
            shape = [1, 1, 1]
            shape[2 - axis] = count
            nearest = nearest + (inside**2).reshape(shape)
            farthest = farthest + (outside**2).reshape(shape)
        return self._at_square(farthest), self._at_square(nearest)

    def mean(self) -> float:
        """Return the mean over the box: a product of three differences of error functions."""
        scale = 1.0 / (np.sqrt(2.0) * self._width)
        along = special.gauss_integral(-self._center * scale, self.extent * scale)
        return float(self.numbers["peak"] * np.prod(along / (self.extent * scale)))
