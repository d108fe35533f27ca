"""A procedural cumulus, the same on every machine and with every version of numpy.

Only additions, multiplications, divisions and comparisons, which IEEE 754 rounds in one way, and
the raw output of PCG64: no library of functions, compiler or processor can change a bit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freepath.scene.cache import cached
from freepath.scene.media.base import Array
from freepath.scene.randomness import uniforms

VERSION = 1  # of the shape: a higher one makes cached clouds worthless
OCTAVES = (3, 6, 12, 24, 48, 96)  # lattice cells of the noise along the box
EMPTY = 0.75  # share of voxels without density
BLOBS = 12
SLAB = 1 << 17  # voxels worked on at a time

Field = NDArray[np.float32]


def cloud(resolution: int, seed: int) -> Field:
    """Return densities [z, y, x] of a cloud in a cube, float32, at least 0, the largest exactly 1.

    About 75 % of the voxels are empty. The seed alone makes the shape; the resolution says how
    finely it is sampled, at the voxels' centres.
    """
    return cached(f"cloud-{VERSION}-{resolution}-{seed}", lambda: _density(resolution, seed))


def _density(resolution: int, seed: int) -> Field:
    shape = _Shape(seed)
    field = shape.sample(resolution)
    # The share of empty voxels is set on a coarse sampling of its own, so that the surface is at
    # the same place at any resolution; a handful of voxels may all be outside of it.
    coarse = np.sort(shape.sample(32), axis=None)
    surface = min(coarse[int(EMPTY * coarse.size)], field.max() - np.float32(0.01))
    for plane in field:
        above = np.maximum(plane - surface, np.float32(0.0))
        plane[...] = above / (above + np.float32(1.0))  # a soft rim around a dense core
    field /= field.max()
    return field


class _Shape:
    """A heap of blobs on a flat base, its surface displaced by billows: a field without units."""

    def __init__(self, seed: int):
        self._blobs = _blobs(uniforms(seed, 0, (BLOBS, 4)))
        # three components of a gradient at every lattice point, in [-1, 1)
        self._gradients = [
            2.0 * uniforms(seed, cells, (3, cells + 1, cells + 1, cells + 1)) - 1.0
            for cells in OCTAVES
        ]

    def sample(self, resolution: int) -> Field:
        """Return the field at the centres of resolution^3 voxels, [z, y, x]."""
        centres = (np.arange(resolution) + 0.5) / resolution
        field = np.empty((resolution,) * 3, dtype=np.float32)
        step = max(1, SLAB // resolution**2)
        for first in range(0, resolution, step):
            heights = centres[first : first + step]
            field[first : first + step] = self._slab(heights, centres)
        return field

    def _slab(self, heights: Array, centres: Array) -> Array:
        field = self._envelope(heights, centres)
        weight = 1.4
        for gradients in self._gradients:
            noise = _gradient_noise(gradients, heights, centres)
            field += weight * (np.abs(noise) - 0.2)  # the fold at 0 makes creases between billows
            weight /= 1.6
        return field

    def _envelope(self, heights: Array, centres: Array) -> Array:
        heap = np.full((len(heights), len(centres), len(centres)), -np.inf)
        for x, y, z, radius in self._blobs:
            square = np.square(heights - z)[:, None, None] + np.square(centres - y)[:, None]
            np.maximum(heap, 1.0 - (square + np.square(centres - x)) / (radius * radius), out=heap)
        base = np.minimum((heights - 0.18) * 12.0, 0.0)[:, None, None]
        return 0.6 * heap + base


def _blobs(draws: Array) -> Array:
    """Place blobs as rows of x, y, z and radius: one in the middle, the others heaped around it."""
    across, deep, high, size = draws.T
    height = 0.25 + 0.4 * high
    spread = 0.56 * (1.0 - 0.6 * (height - 0.25) / 0.4)  # narrower towards the top
    radius = 0.13 + 0.09 * size
    blobs = np.stack(
        [0.5 + spread * (across - 0.5), 0.5 + spread * (deep - 0.5), height, radius], axis=1
    )
    blobs[0] = 0.5, 0.5, 0.36, 0.26
    return blobs


def _gradient_noise(gradients: Array, heights: Array, centres: Array) -> Array:
    """Interpolate the gradients' ramps between lattice points (Perlin 2002, Improving noise).

    Each component's ramp is a product over the axes, so that a slab costs one axis after another;
    the last and by far the largest one is shared by the components that have no ramp along it.
    """
    cells = gradients.shape[1] - 1
    below, plain, ramped = _weights(centres, cells)
    z_below, z_plain, z_ramped = _weights(heights, cells)
    along_x, along_y, along_z = (
        _blend(_blend(component, z_below, z_weights, 0), below, y_weights, 1)
        for component, z_weights, y_weights in zip(
            gradients, (z_plain, z_plain, z_ramped), (plain, ramped, plain), strict=True
        )
    )
    return _blend(along_x, below, ramped, 2) + _blend(along_y + along_z, below, plain, 2)


def _blend(
    values: Array, below: NDArray[np.intp], weights: tuple[Array, Array], axis: int
) -> Array:
    shape = [-1 if place == axis else 1 for place in range(3)]
    low, high = (weight.reshape(shape) for weight in weights)
    result = low * np.take(values, below, axis=axis)
    result += high * np.take(values, below + 1, axis=axis)
    return result


def _weights(
    points: Array, cells: int
) -> tuple[NDArray[np.intp], tuple[Array, Array], tuple[Array, Array]]:
    """Return the lattice point below, and the weights of both without and with their ramps."""
    position = points * cells
    below = np.minimum(position.astype(np.intp), cells - 1)
    t = position - below
    fade = t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
    return below, (1.0 - fade, fade), ((1.0 - fade) * t, fade * (t - 1.0))
