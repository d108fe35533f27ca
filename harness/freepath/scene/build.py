"""From a config's model of a medium to the medium."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from freepath.errors import VolumeError
from freepath.scene.media.base import Array, Medium
from freepath.scene.media.cloud import cloud
from freepath.scene.media.formulas import Cosine, Exponential, Homogeneous, Layered, Linear
from freepath.scene.media.gaussian import Gaussian
from freepath.scene.media.grid import GridMedium
from freepath.scene.volumes.files import find_file
from freepath.scene.volumes.reading import Volume, extinction, read_volume

SearchPath = Iterable[str | Path]


def build_medium(model: Any, search_path: SearchPath = ()) -> Medium:
    """Return the medium that a config's model describes.

    A volume's file is looked for in the folders of `search_path` first, see `find_file`. Raises
    VolumeError for a file that is not found, cannot be read or holds no densities.
    """
    medium = _KINDS[model.kind](model, search_path)
    if model.channels:
        medium.channels = np.array(model.channels)
    return medium


def _homogeneous(model: Any, _: SearchPath) -> Medium:
    return Homogeneous(model.sigma_t, model.size)


def _linear(model: Any, _: SearchPath) -> Medium:
    return Linear(model.bottom, model.top, model.size)


def _exponential(model: Any, _: SearchPath) -> Medium:
    return Exponential(model.sigma_t, model.scale_height, model.size)


def _gaussian(model: Any, _: SearchPath) -> Medium:
    return Gaussian(model.sigma_t, model.width, model.center, model.size)


def _cosine(model: Any, _: SearchPath) -> Medium:
    return Cosine(model.sigma_t, model.amplitude, model.periods, model.phase, model.size)


def _layered(model: Any, _: SearchPath) -> Medium:
    return Layered(model.breakpoints, model.values, model.size)


def _cloud(model: Any, _: SearchPath) -> Medium:
    densities = cloud(model.resolution, model.seed)
    if model.floor:
        densities = np.float32(model.floor) + np.float32(1 - model.floor) * densities
    name = f"cloud {model.resolution}"
    voxels = extinction(densities, model.sigma_t, name)
    voxel_size = np.asarray(model.size, dtype=np.float64) / model.resolution
    return GridMedium(voxels, np.diag([*(1.0 / voxel_size), 0.0])[:3], model.interpolation, name)


def _volume(model: Any, search_path: SearchPath) -> Medium:
    path = find_file(model.file, search_path)
    return medium_of(read_volume(path, model.grid, model.raw), model)


def medium_of(volume: Volume, model: Any) -> GridMedium:
    """Return the medium of a volume that was read, as a config's model describes it."""
    to_world = volume.to_world
    if model.voxel_size is not None:
        spacing = np.broadcast_to(np.asarray(model.voxel_size, dtype=np.float64), 3)
        to_world = np.diag([*spacing, 0.0])[:3]
    voxels = extinction(volume.densities, model.sigma_t, volume.path, volume.first)
    to_medium = _inverse(to_world, volume.path)
    name = str(volume.path)
    medium = GridMedium(voxels, to_medium, model.interpolation, name, volume.first)
    medium.told = volume.told
    return medium


def _inverse(affine: Array, path: Path) -> Array:
    """Invert an affine map (3, 4)."""
    try:
        linear = np.linalg.inv(affine[:, :3])
    except np.linalg.LinAlgError:
        linear = np.full((3, 3), np.nan)
    inverse = np.column_stack([linear, -linear @ affine[:, 3]])
    if not np.isfinite(inverse).all():
        raise VolumeError(f"{path}: its transform cannot be inverted: {affine.tolist()}")
    return inverse


_KINDS: dict[str, Callable[[Any, SearchPath], Medium]] = {
    "homogeneous": _homogeneous,
    "linear": _linear,
    "exponential": _exponential,
    "gaussian": _gaussian,
    "cosine": _cosine,
    "layered": _layered,
    "cloud": _cloud,
    "volume": _volume,
}
