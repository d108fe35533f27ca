"""How dense a medium is along rays, and which grid of majorants promises the least work in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freepath.scene.media.base import Array, Medium
from freepath.scene.media.grid import GridMedium


@dataclass(frozen=True)
class Density:
    """Optical depths: mean and largest along `rays` rays, and of a voxel where it is densest."""

    rays: int
    mean: float
    largest: float
    voxel: float

    def __str__(self) -> str:
        free = f" (a mean free path is {1 / self.voxel:.3g} voxels there)" if self.voxel else ""
        return (
            f"optical depth along {self.rays} rays: mean {self.mean:.3g}, largest "
            f"{self.largest:.3g}; of a voxel where it is densest {self.voxel:.3g}{free}"
        )


def density(medium: Medium, segments: Array, side: float) -> Density:
    """Return the density along segments (N, 7); `side` is that of a voxel in the world."""
    depths = medium.optical_depth(segments)
    voxel = float(medium.bounds((1, 1, 1))[1].max()) * side
    return Density(len(depths), float(depths.mean()), float(depths.max()), voxel)


@dataclass(frozen=True)
class Work:
    """What ratio tracking does along a whole ray, on average, with majorants of so many cells."""

    cells: tuple[int, int, int]
    """Along x, y, z."""
    lookups: float
    crossings: float

    @property
    def steps(self) -> float:
        """Lookups and crossings of cells, counted alike."""
        return self.lookups + self.crossings


def work(medium: Medium, segments: Array, cells: Sequence[int]) -> Work:
    """Return the expected work along segments (N, 7) of tight majorants over cells (x, y, z).

    Lookups are Poisson with the integral of the majorant as their mean, so nothing is sampled: the
    majorants are a grid of their own, whose optical depth is that integral.
    """
    counts = nx, ny, nz = (int(cells[0]), int(cells[1]), int(cells[2]))
    upper = medium.bounds(counts)[1].astype(np.float32)
    coarse = GridMedium(upper, np.eye(3, 4), "nearest")
    scaled = segments.copy()
    scaled[:, :6] *= np.tile(np.array(counts) / medium.extent, 2)
    lookups = crossings = 0.0
    for _, pieces in coarse.chunks(scaled):
        lookups += pieces.depth.sum()
        crossings += np.maximum((pieces.length > 0.0).sum(axis=1) - 1, 0).sum()
    return Work((nx, ny, nz), lookups / len(segments), crossings / len(segments))
