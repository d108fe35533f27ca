"""Reading densities on voxels, and refusing what is no density."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from freepath.errors import VolumeError
from freepath.scene.volumes.npy import MOST_VOXELS, open_npy

WITH_GRIDS = (".vdb", ".nvdb")
ARRAYS = (".vol", ".pbrt")


@dataclass(frozen=True)
class Volume:
    """Densities as they are in the file, [z, y, x], and where its voxels are in the world.

    `to_world` (3, 4) is affine and takes voxel units, in which voxel (i, j, k) covers [i, i + 1] x
    [j, j + 1] x [k, k + 1], to the world.
    """

    path: Path
    densities: NDArray
    to_world: NDArray[np.float64]
    first: tuple[int, int, int] = (0, 0, 0)
    """The index of the first voxel in the file's own count, [z, y, x]."""
    grid: str = ""
    """The grid's name and type, where the format has grids."""
    background: float | None = 0.0
    """What the file says is outside of the box; None where that is not known."""
    others: tuple[str, ...] = ()
    """The other grids of the file."""
    remark: str = ""
    """What else is to be said."""

    @property
    def told(self) -> str:
        """What of which file it is."""
        shape = self.densities.shape
        text = f"{' x '.join(map(str, shape))} voxels [z, y, x] of {self.densities.dtype}"
        if self.grid:
            low = list(reversed(self.first))
            high = [a + b - 1 for a, b in zip(low, reversed(shape), strict=True)]
            outside = "unknown" if self.background is None else f"{self.background:g}"
            text = f"{self.grid}, active box {low} to {high} [x, y, z], background {outside}"
        return f"{self.path}: {text}{self.remark and f'; {self.remark}'}"


def read_volume(path: Path, grid: str | None = None, raw: str | None = None) -> Volume:
    """Read a file in a format that docs/files.md lists, by its suffix.

    `grid` names a grid of OpenVDB or NanoVDB ('' one without a name, `density[1]` the second of
    that name); without it, the one called `density` or the only grid of scalars. `raw` says what
    raw numbers are, see `read_raw`. Raises VolumeError, with the file in its message.
    """
    suffix = path.suffix.lower()
    if grid is not None and suffix not in WITH_GRIDS:
        raise VolumeError(f"{path}: grid {grid!r}: only OpenVDB and NanoVDB files have named grids")
    if raw is not None or suffix in ARRAYS:
        from freepath.scene.volumes import arrays

        if raw is not None:
            volume = arrays.read_raw(path, raw)
        else:
            volume = arrays.read_vol(path) if suffix == ".vol" else arrays.read_pbrt(path)
    elif suffix == ".npy":
        volume = Volume(path, open_npy(path), np.eye(3, 4))
        if volume.densities.ndim != 3:
            found = f"{volume.densities.ndim}, its shape is {volume.densities.shape}"
            raise VolumeError(f"{path}: expected an array of rank 3 [z, y, x], got rank {found}")
    elif suffix == ".vdb":
        from freepath.scene.volumes.openvdb import read_openvdb

        volume = read_openvdb(path, grid)
    elif suffix == ".nvdb":
        from freepath.scene.volumes.nanovdb import read_nanovdb

        volume = read_nanovdb(path, grid)
    else:
        from freepath.scene.volumes.images import read_slices

        volume = Volume(path, *read_slices(path))
    if volume.densities.size > MOST_VOXELS:
        raise VolumeError(f"{path}: {volume.densities.size} voxels, expected at most {MOST_VOXELS}")
    if volume.background:
        endless = "outside of its active box the medium would never end; expected 0"
        raise VolumeError(f"{path}: its background is {volume.background:g}: {endless}")
    return volume


def extinction(
    densities: NDArray,
    sigma_t: float,
    name: str | Path,
    first: tuple[int, int, int] = (0, 0, 0),
) -> NDArray[np.float32]:
    """Return densities [z, y, x] times sigma_t, rounded once to float32.

    Raises VolumeError with the first voxel, its value and the count of each kind where densities
    are NaN, infinite or negative, or where a product does not fit into float32. Voxels are named
    [z, y, x], counted from `first` on.
    """
    result = np.empty(densities.shape, dtype=np.float32)
    largest = float(np.finfo(np.float32).max)
    found: dict[str, list] = {}
    for z, plane in enumerate(densities):
        values = np.asarray(plane, dtype=np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            scaled = values * sigma_t
            result[z] = scaled
        kinds = {
            "NaN": np.isnan(values),
            "infinite": np.isinf(values),
            "negative": (values < 0.0) & (values > -np.inf),
            f"too large for float32 once multiplied by sigma_t = {sigma_t:g}": (
                (np.abs(scaled) > largest) & np.isfinite(values)
            ),
        }
        for kind, wrong in kinds.items():
            if wrong.any():
                y, x = (int(i) for i in np.argwhere(wrong)[0])
                at = [start + i for start, i in zip(first, (z, y, x), strict=True)]
                place = f"first [z, y, x] = {at}: {values[y, x]:.6g}"
                found.setdefault(kind, [0, place])[0] += int(wrong.sum())
    if found:
        parts = [f"{count} {kind} ({place})" for kind, (count, place) in found.items()]
        raise VolumeError(f"{name}: densities that cannot be used: {', '.join(parts)}")
    return result
