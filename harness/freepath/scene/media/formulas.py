"""The media that vary with the height alone: homogeneous, linear, exponential, cosine, layered.

All are boxes [0, size] in medium coordinates, which are world coordinates: their lower corner is
the origin. The formulas are integrals of the
definitions in the classes' first lines; the comments say why they are written as they are.
"""

from __future__ import annotations

import numpy as np

from freepath.scene import special
from freepath.scene.media.base import Array, Index, Medium, Pieces, crossings, partition
from freepath.scene.media.cells import over_ranges
from freepath.scene.media.closed_form import HeightMedium, Size


class Homogeneous(HeightMedium):
    """The same everywhere. numbers: sigma_t."""

    kernel = "homogeneous"
    offers = frozenset({"closed_form", "cells"})

    def __init__(self, sigma_t: float, size: Size):
        super().__init__(size, {"sigma_t": sigma_t})
        self._sigma_t = float(sigma_t)

    def sigma_t(self, points: Array) -> Array:
        """Return the one extinction at every point."""
        return np.full(len(points), self._sigma_t)

    def optical_depth(self, segments: Array) -> Array:
        """Return sigma_t * length."""
        return self._sigma_t * segments[:, 6]

    def distance(self, segments: Array, depth: Array) -> Array:
        """Return depth / sigma_t, inf where that lies beyond the segment."""
        inside = depth < self.optical_depth(segments)
        return np.where(inside, depth / (self._sigma_t or 1.0), np.inf)

    def _height_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        return (np.full(len(lower), self._sigma_t),) * 2


class Linear(HeightMedium):
    """sigma_t(z) = bottom + slope * z. numbers: bottom, slope (per unit of height)."""

    kernel = "linear"

    def __init__(self, bottom: float, top: float, size: Size):
        super().__init__(size, {"bottom": bottom, "slope": (top - bottom) / size[2]})
        self._bottom, self._top = float(bottom), float(top)

    def _at(self, height: Array) -> Array:
        # bottom + slope * z would lose the digits of a medium that ends in nothing
        share = np.clip(height / self.extent[2], 0.0, 1.0)
        return (1.0 - share) * self._bottom + share * self._top

    def sigma_t(self, points: Array) -> Array:
        """Return the extinction, interpolated between bottom and top."""
        return self._at(points[:, 2])

    def optical_depth(self, segments: Array) -> Array:
        """Return length times the mean of the extinctions at both ends."""
        start, rise, length = segments[:, 2], segments[:, 5], segments[:, 6]
        return length * (self._at(start) + self._at(start + rise * length)) / 2.0

    def distance(self, segments: Array, depth: Array) -> Array:
        """Return t = 2 E / (a + sqrt(a^2 + 2 b E)): the root of a t + b t^2 / 2 = E.

        In this form of the quadratic formula nothing cancels for small b.
        """
        start = self._at(segments[:, 2])
        slope = self.numbers["slope"] * segments[:, 5]
        inside = depth < self.optical_depth(segments)
        root = start + np.sqrt(np.maximum(start**2 + 2.0 * slope * depth, 0.0))
        length = 2.0 * depth / np.where(root > 0.0, root, 1.0)
        return np.where(inside, np.minimum(length, segments[:, 6]), np.inf)

    def _height_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        ends = self._at(lower), self._at(upper)
        return np.minimum(*ends), np.maximum(*ends)


class Exponential(HeightMedium):
    """sigma_t(z) = sigma_t * exp(-inverse_height * z). numbers: sigma_t, inverse_height."""

    kernel = "exponential"

    def __init__(self, sigma_t: float, scale_height: float, size: Size):
        super().__init__(size, {"sigma_t": sigma_t, "inverse_height": 1.0 / scale_height})
        self._sigma_t, self._scale_height = float(sigma_t), float(scale_height)

    def _at(self, height: Array) -> Array:
        return self._sigma_t * np.exp(-height / self._scale_height)

    def sigma_t(self, points: Array) -> Array:
        """Return the extinction, which falls by e with every scale height."""
        return self._at(points[:, 2])

    def optical_depth(self, segments: Array) -> Array:
        """Return (m H / w)(1 - exp(-w t / H)), taken from the lower end of the segment.

        From there the exponent is never positive, so that neither end overflows; for w -> 0 the
        quotient tends to 1.
        """
        start, rise, length = segments[:, 2], segments[:, 5], segments[:, 6]
        lowest = np.minimum(start, start + rise * length)
        thickness = np.abs(rise) * length / self._scale_height
        return self._at(lowest) * length * special.decay_mean(thickness)

    def distance(self, segments: Array, depth: Array) -> Array:
        """Return t = -(H / w) log(1 - E w / (m0 H)), m0 the extinction at the start."""
        rate = segments[:, 5] / self._scale_height
        inside = depth < self.optical_depth(segments)
        start = self._at(segments[:, 2])
        with np.errstate(all="ignore"):
            here = depth / start
            length = here * special.log1p_ratio(np.where(inside, -rate * here, 0.0))
            # where the medium at the start underflows and the ray goes down into it: by logarithms
            exponent = np.log(-rate * depth / self._sigma_t) + segments[:, 2] / self._scale_height
            from_nothing = np.logaddexp(0.0, exponent) / -rate
        length = np.where(start > 1e-290, length, from_nothing)
        return np.where(inside, np.minimum(length, segments[:, 6]), np.inf)

    def _cuts(self, segments: Array) -> Array:
        count = min(int(self.extent[2] / self._scale_height), 750)  # exp(-750) is 0
        heights = self._scale_height * np.arange(1, count + 1)
        return crossings(segments[:, 2], segments[:, 5], heights, segments[:, 6])

    def _height_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        return self._at(upper), self._at(lower)


class Cosine(HeightMedium):
    """sigma_t(z) = mean (1 + amplitude cos(wavenumber z + phase)).

    numbers: mean, amplitude, wavenumber (radians per unit of height), phase (radians).
    """

    kernel = "cosine"

    def __init__(self, mean: float, amplitude: float, periods: float, phase: float, size: Size):
        wavenumber = 2.0 * np.pi * periods / size[2]
        numbers = {"mean": mean, "amplitude": amplitude, "wavenumber": wavenumber, "phase": phase}
        super().__init__(size, numbers)

    def _angle(self, height: Array) -> Array:
        return self.numbers["wavenumber"] * height + self.numbers["phase"]

    def _scaled(self, crest: Array) -> Array:
        """Return mean (1 - amplitude + amplitude * crest), crest being 1 + cosine."""
        amplitude = self.numbers["amplitude"]
        return self.numbers["mean"] * ((1.0 - amplitude) + amplitude * crest)

    def sigma_t(self, points: Array) -> Array:
        """Return the extinction; 1 + cos x as 2 cos^2(x / 2) keeps the digits near its zeros."""
        return self._scaled(2.0 * np.cos(self._angle(points[:, 2]) / 2.0) ** 2)

    def optical_depth(self, segments: Array) -> Array:
        """Return mean t (1 + amplitude c s): c the cosine halfway, s = sin(x) / x, x half the turn.

        1 + c s is (1 - |s|) + |s| (1 + c or 1 - c), a sum of two parts that are not negative.
        """
        start, rise, length = segments[:, 2], segments[:, 5], segments[:, 6]
        half_turn = self.numbers["wavenumber"] * rise * length / 2.0
        halfway = self._angle(start + rise * length / 2.0) / 2.0
        share = special.sinc(half_turn)
        crest = 2.0 * np.where(share >= 0.0, np.cos(halfway), np.sin(halfway)) ** 2
        flat = np.where(share >= 0.0, special.sinc_complement(half_turn), 1.0 + share)
        return length * self._scaled(flat + np.abs(share) * crest)

    def _cuts(self, segments: Array) -> Array:
        first, last = self._angle(np.array([0.0, self.extent[2]])) / np.pi
        extremes = np.arange(np.ceil(first), np.floor(last) + 1.0) * np.pi
        heights = (extremes - self.numbers["phase"]) / self.numbers["wavenumber"]
        return crossings(segments[:, 2], segments[:, 5], heights, segments[:, 6])

    def _height_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        first, last = self._angle(lower) / (2.0 * np.pi), self._angle(upper) / (2.0 * np.pi)
        crests = [2.0 * np.cos(np.pi * turn) ** 2 for turn in (first, last)]
        has_crest = np.ceil(first) <= np.floor(last)
        has_trough = np.ceil(first - 0.5) <= np.floor(last - 0.5)
        lowest = np.where(has_trough, 0.0, np.minimum(*crests))
        highest = np.where(has_crest, 2.0, np.maximum(*crests))
        return self._scaled(lowest), self._scaled(highest)


class Layered(HeightMedium):
    """Layers of constant extinction, stacked along z.

    numbers: layers (their count n). data: the n extinctions from the bottom up, then the n + 1
    heights of their boundaries, from 0 to the height of the box. A boundary belongs to the layer
    above it.
    """

    kernel = "layered"
    offers = frozenset({"closed_form", "cells"})
    optical_depth = Medium.optical_depth

    def __init__(self, breakpoints: tuple[float, ...], values: tuple[float, ...], size: Size):
        self._values = np.asarray(values, dtype=np.float64)
        self._boundaries = np.array([0.0, *breakpoints, size[2]])
        data = np.concatenate([self._values, self._boundaries]).astype(np.float32)
        super().__init__(size, {"layers": len(values)}, data=data)

    def _layer(self, height: Array) -> Index:
        layer = np.searchsorted(self._boundaries, height, side="right") - 1
        return np.clip(layer, 0, len(self._values) - 1)

    def sigma_t(self, points: Array) -> Array:
        """Return the extinction of the layer that each point is in."""
        return self._values[self._layer(points[:, 2])]

    def pieces(self, segments: Array) -> Pieces:
        """Cut segments (N, 7) at the boundaries."""
        inner = self._boundaries[1:-1]
        cuts = crossings(segments[:, 2], segments[:, 5], inner, segments[:, 6])
        start, length = partition(cuts, segments[:, 6])
        middle = segments[:, 2, None] + (start + length / 2.0) * segments[:, 5, None]
        depth = self._values[self._layer(middle)] * length

        def partial(segment: Index, piece: Index, fraction: Array) -> Array:
            return fraction * depth[segment, piece]

        return Pieces(start, length, depth, partial)

    @property
    def pieces_per_segment(self) -> int:
        """Width of the arrays that `pieces` returns: the number of layers."""
        return len(self._values)

    def _height_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        first = self._layer(lower)
        last = np.maximum(first, np.searchsorted(self._boundaries, upper, side="left") - 1)
        last = np.minimum(last, len(self._values) - 1)
        return tuple(over_ranges(self._values, f, first, last, 0) for f in (np.minimum, np.maximum))

    def _content(self) -> tuple[Array, ...]:
        return self._values, self._boundaries
