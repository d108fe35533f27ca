"""What is in a volume, and how to use it: what one looks at first in a file of one's own."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from freepath.config.models import MEDIA, MOST_CELLS
from freepath.config.rays import Orthographic
from freepath.extras.recommend import RAYS, SEED, as_yaml
from freepath.measure import pictures
from freepath.scene import build, make_rays, segments, survey
from freepath.scene.media.grid import GridMedium
from freepath.scene.volumes.reading import Volume

CELLS = (64, 32, 16, 8, 4, 2)
"""Voxels along a side of a majorant's cell."""
EMPTY_CELL = 8
"""Voxels along a side of the cells of which it is told how many are empty."""
WORKING = 48 << 20
"""Bytes that optical depths take, of any volume: rays are cut into pieces a few at a time."""
SHADES = " .:-=+*#%@"
LARGEST = 1024
"""Pixels along a side of a PNG."""
Facts = dict[str, Any]


class Contents:
    """A volume with the extinction that a config's keys (`file`, `sigma_t`, ...) make of it."""

    def __init__(self, volume: Volume, keys: Facts):
        """Raises VolumeError where densities or transform cannot be used."""
        self.volume, self.keys = volume, keys
        self.medium: GridMedium = build.medium_of(volume, MEDIA["volume"].model_validate(keys))
        self.shape = tuple(reversed(volume.densities.shape))
        to_world = np.linalg.inv(np.vstack([self.medium.to_medium, [0, 0, 0, 1]]))[:3]
        # the medium has two voxels where the file has one
        to_world[:, :3] *= self.medium.extent / self.shape
        self.to_world = to_world
        self.sides = np.linalg.norm(to_world[:, :3], axis=0)
        """Of a voxel in the world, along x, y, z."""

    def facts(self) -> Facts:
        """All that is known, fit for JSON."""
        medium, volume = self.medium, self.volume
        planes = [np.asarray(plane) for plane in volume.densities]
        corners = medium.world_box()
        blocks = medium.bounds(tuple(max(1, n // EMPTY_CELL) for n in self.shape))[1]
        grids = self._majorants()
        density = survey.density(medium, self._segments, float(self.sides.min()))
        best = min(grids, key=lambda one: one.steps)
        return {
            "what": volume.told,
            "grid": volume.grid,
            "other_grids": list(volume.others),
            "background": volume.background,
            "type": str(volume.densities.dtype),
            "voxels_xyz": self.shape,
            "first_xyz": tuple(reversed(volume.first)),
            "voxel_to_world": self.to_world.tolist(),
            "voxel_sides": self.sides.tolist(),
            "world_low": corners.min(axis=0).tolist(),
            "world_high": corners.max(axis=0).tolist(),
            "minimum": float(min(plane.min() for plane in planes)),
            "maximum": float(max(plane.max() for plane in planes)),
            "mean": float(np.mean([plane.mean(dtype=np.float64) for plane in planes])),
            "empty_share": 1.0 - sum(map(np.count_nonzero, planes)) / volume.densities.size,
            "empty_cells_share": float((blocks == 0.0).mean()),
            "sigma_t": self.keys["sigma_t"],
            "rays": density.rays,
            "optical_depth_mean": density.mean,
            "optical_depth_largest": density.largest,
            "optical_depth_of_a_voxel": density.voxel,
            "optical_depths": str(density),
            "bytes_float": medium.voxels.nbytes,
            "bytes_half": medium.voxels.nbytes // 2,
            # a grid of majorants has a border of a cell
            "bytes_majorant": 4 * math.prod(n + 2 for n in best.cells if max(best.cells) > 1),
            "bytes_here": volume.densities.nbytes + 3 * medium.voxels.nbytes + WORKING,
            "majorants": [vars(one) | {"steps": one.steps} for one in grids],
            "majorant": best.cells,
            "config": self.config(best.cells),
        }

    @property
    def _segments(self) -> np.ndarray:
        rays = Orthographic.model_validate(RAYS["orthographic"])
        return segments(*make_rays(rays, self.medium, SEED), self.medium)

    def _majorants(self) -> list[survey.Work]:
        """The work of majorants, from one for all to the finest grid; each once."""
        counts = [tuple(math.ceil(n / side) for n in self.shape) for side in CELLS]
        few = [one for one in dict.fromkeys([(1, 1, 1), *counts]) if math.prod(one) <= MOST_CELLS]
        return [survey.work(self.medium, self._segments, one) for one in few]

    def config(self, cells: tuple[int, int, int]) -> list[str]:
        """The two lines of a config's matrix that use it."""
        majorant = "global" if max(cells) == 1 else {"grid": {"resolution": list(cells)}}
        medium = {"volume": self.keys}
        return [f"  medium: {as_yaml(medium)}", f"  majorant: {as_yaml(majorant)}"]

    def projection(self, along: str | None = None) -> tuple[np.ndarray, tuple[float, float], str]:
        """Return optical depths [rows, columns] along an axis of the voxels, and which one.

        Without a name, it is the one along which the box is shortest. The sides of a pixel are
        (height, width) in the world. Rows are from the top, where the other axis that comes last is
        highest. Through the centres of voxels a sum is exact for both interpolations.
        """
        sides = self.sides * self.shape / self.medium.extent
        lengths = self.medium.extent * sides
        axis = int(np.argmin(lengths)) if along is None else "xyz".index(along)
        depths = self.medium.voxels.sum(axis=2 - axis, dtype=np.float64) * sides[axis]
        width, height = (float(side) for a, side in enumerate(sides) if a != axis)
        return depths[::-1], (height, width), "xyz"[axis]


def text(facts: Facts) -> Iterator[str]:
    """Yield the lines that tell facts."""
    sides, matrix = facts["voxel_sides"], facts["voxel_to_world"]
    by = " x ".join
    yield facts["what"]
    if facts["other_grids"]:
        yield f"other grids: {', '.join(facts['other_grids'])}"
    yield (
        f"{by(map(str, facts['voxels_xyz']))} voxels along x, y, z of {facts['type']}, each "
        f"{by(f'{side:.4g}' for side in sides)}; the box in the world is "
        f"{_shown(facts['world_low'])} to {_shown(facts['world_high'])}"
    )
    if any(matrix[i][j] for i in range(3) for j in range(3) if i != j):
        yield f"voxels to world, turned or sheared: {', '.join(map(_shown, matrix))}"
    yield (
        f"densities {facts['minimum']:.4g} to {facts['maximum']:.4g}, mean {facts['mean']:.4g}; "
        f"empty: {100 * facts['empty_share']:.3g} % of the voxels, "
        f"{100 * facts['empty_cells_share']:.3g} % of cells of {EMPTY_CELL} x {EMPTY_CELL} x "
        f"{EMPTY_CELL}"
    )
    yield f"at sigma_t = {facts['sigma_t']:g}: {facts['optical_depths']}"
    names = ("bytes_float", "bytes_half", "bytes_here")
    whole, half, here = (f"{facts[name] / 2**20:.3g} MiB" for name in names)
    yield f"memory: {whole} on the device as float, {half} as half; up to {here} here"
    best = next(one for one in facts["majorants"] if one["cells"] == facts["majorant"])
    yield (
        f"majorants: {by(map(str, best['cells']))} cells are the least work of "
        f"{len(facts['majorants'])} grids: {best['lookups']:.3g} lookups + {best['crossings']:.3g} "
        f"crossings along a whole ray (ratio tracking, tightness 1, counted alike; with one "
        f"majorant {facts['majorants'][0]['lookups']:.3g} lookups)"
    )


def _shown(numbers: list[float]) -> str:
    return f"[{', '.join(f'{one:.4g}' for one in numbers)}]"


def resized(depths: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Average over the pixels of another size: the box filter, exact for any two sizes."""
    for axis, count in enumerate((rows, columns)):
        old = depths.shape[axis]
        edges = np.linspace(0.0, old, count + 1)
        running = np.insert(np.cumsum(depths, axis=axis), 0, 0.0, axis=axis)
        at_edges = np.apply_along_axis(
            lambda one, edges=edges: np.interp(edges, np.arange(len(one)), one), axis, running
        )
        depths = np.diff(at_edges, axis=axis) * (count / old)
    return depths


def drawn(depths: np.ndarray, pixel: tuple[float, float], columns: int, rows: int) -> list[str]:
    """Draw a projection in letters that are twice as high as wide, at most so many."""
    height, width = (n * side for n, side in zip(depths.shape, pixel, strict=True))
    columns = max(1, min(columns, round(2 * rows * width / height)))
    rows = max(1, min(rows, round(columns * height / width / 2)))
    shown = pictures.exposed(resized(depths, rows, columns)[..., None])[0][..., 0]
    levels = np.ceil(shown ** (1 / 2.2) * (len(SHADES) - 1)).astype(int)
    return ["".join(SHADES[level] for level in row).rstrip() for row in levels]


def write_png(depths: np.ndarray, pixel: tuple[float, float], path: Path) -> None:
    """Write a projection with square pixels; FreepathError or OSError where that fails."""
    height, width = (n * side for n, side in zip(depths.shape, pixel, strict=True))
    finest = max(min(pixel), max(height, width) / LARGEST)
    rows, columns = (max(1, round(side / finest)) for side in (height, width))
    shown, exposure = pictures.exposed(resized(depths, rows, columns)[..., None])
    told = {"freepath:exposure": f"{exposure:g}"}
    pictures.write_png(path.with_suffix(""), shown, told)
