"""Environments as images: their radiance by direction, resampled to a small table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freepath.compose.light_paths import SKY_COLUMNS, SKY_ROWS
from freepath.errors import VolumeError, imported
from freepath.scene.media.base import Array
from freepath.scene.volumes.files import find_file
from freepath.scene.volumes.images import check_claim, opened, pixels_of
from freepath.scene.volumes.npy import first_line

PLACE = "[row, column, channel]"


@dataclass(frozen=True)
class Sky:
    """Radiance in all directions, as kernels read it: piecewise bilinear in latitude and longitude.

    `table` is (channels, SKY_ROWS + 2, SKY_COLUMNS) float32. Rows are centres of equal steps of
    latitude, from +z down; longitude starts at -x, passes +y, and has +x in the middle. The first
    and last row lie beyond the poles and make all columns meet at a pole in the mean of its row.
    """

    table: NDArray[np.float32]
    told: str = ""
    """What of the file it is."""

    @classmethod
    def of(cls, pixels: Array) -> Sky:
        """Make the table of an image [SKY_ROWS, SKY_COLUMNS, channels]."""
        top, bottom = (2 * row.mean(axis=0) - row for row in (pixels[0], pixels[-1]))
        table = np.concatenate([top[None], pixels, bottom[None]])
        return cls(np.ascontiguousarray(np.moveaxis(table, 2, 0), dtype=np.float32))

    @cached_property
    def fingerprint(self) -> bytes:
        """Identifies the radiance."""
        return self.table.tobytes()

    def radiance(self, directions: Array) -> Array:
        """Return the radiance from directions (N, 3) of the world, of any length, (N, channels)."""
        x, y, z = directions.T
        off = np.hypot(x, y)
        longitude = np.where(off == 0, 0.0, np.arctan2(y, x))
        across = (0.5 - longitude / (2 * np.pi)) * SKY_COLUMNS - 0.5
        down = np.arctan2(off, z) / np.pi * SKY_ROWS + 0.5
        column, row = np.floor(across).astype(int), np.clip(down.astype(int), 0, SKY_ROWS)
        left, right = column % SKY_COLUMNS, (column + 1) % SKY_COLUMNS
        table = self.table.astype(np.float64)
        above, below = (
            table[:, at, left] + (across - column) * (table[:, at, right] - table[:, at, left])
            for at in (row, row + 1)
        )
        return (above + (down - row) * (below - above)).T


def read_sky(light: Any, channels: int, search_path: Iterable[str | Path] = ()) -> Sky:
    """Read the image of a light and resample it for a medium of N channels.

    Of the channels of an EXR file's first part count R, G, B (or Y) of the first layer, else all of
    that layer but alpha; the picture is that of the display window. A grey medium gets the mean
    over these channels, and all channels of another one the only channel of a grey image. Raises
    VolumeError for a file that is not found, is no image of floating-point numbers, has other
    channels, or a value that is no radiance.
    """
    path = find_file(light.file, search_path)
    pixels, told = _read(path)
    pixels = _resampled(path, _checked(path, pixels))
    if channels == 1:
        pixels = pixels.mean(axis=2, keepdims=True)
    elif pixels.shape[2] == 1:
        pixels = np.repeat(pixels, channels, axis=2)
    if pixels.shape[2] != channels:
        found = f"the image has {pixels.shape[2]} channels, expected 1 or {channels}, as many as"
        raise VolumeError(f"{told}: {found} the medium")
    with np.errstate(over="ignore"):
        sky = replace(Sky.of(pixels * light.scale), told=told)
    if not np.isfinite(sky.table).all():
        raise VolumeError(f"{path}: too large for float32 once multiplied by {light.scale:g}")
    return sky


def _read(path: Path) -> tuple[Array, str]:
    """Read the first part of an image file, [rows, columns, channels], and say what of it."""
    oiio = imported("OpenImageIO", str(path))

    with opened(path) as image:
        spec = image.spec()
        if str(spec.format) not in ("half", "float", "double"):
            expected = "expected radiances as floating-point numbers (such as EXR or HDR)"
            raise VolumeError(f"{path}: {expected}, got {spec.format}")
        pixels = _in_display_window(path, spec, pixels_of(path, image, 0, oiio.DOUBLE))
        names, alpha = list(spec.channelnames), spec.alpha_channel
        more = image.seek_subimage(1, 0)
    used = _colours(names, alpha)
    if not used:
        raise VolumeError(f"{path}: has no channel but alpha")
    left = [name for place, name in enumerate(names) if place not in (*used, alpha)]
    left += ["further parts"] * more
    told = f"{path}: channels {', '.join(names[place] for place in used)}"
    return pixels[..., used], told + (f"; not used: {', '.join(left)}" if left else "")


def _in_display_window(path: Path, spec: Any, pixels: Array) -> Array:
    """The picture that an EXR file shows: black where it has no pixels, cut where it has more."""
    origin, size = (spec.full_y, spec.full_x), (spec.full_height, spec.full_width)
    at = np.subtract((spec.y, spec.x), origin)
    if not at.any() and size == pixels.shape[:2]:
        return pixels
    check_claim(path, size[0] * size[1] * spec.nchannels, 8)
    shown = np.zeros((*size, spec.nchannels))
    y, x = np.clip(at, 0, size)
    seen = pixels[max(-at[0], 0) :, max(-at[1], 0) :][: size[0] - y, : size[1] - x]
    shown[y : y + len(seen), x : x + seen.shape[1]] = seen
    return shown


def _colours(names: list[str], alpha: int) -> list[int]:
    """The places of R, G, B, or Y, of the first layer that has them; else all of the first one."""
    layers: dict[str, dict[str, int]] = {}
    for place, name in enumerate(names):
        if place != alpha:
            layer, _, channel = name.rpartition(".")
            layers.setdefault(layer, {})[channel] = place
    for layer in layers.values():
        for wanted in (("R", "G", "B"), ("Y",)):
            if all(channel in layer for channel in wanted):
                return [layer[channel] for channel in wanted]
    return list(next(iter(layers.values()), {}).values())


def _checked(path: Path, pixels: Array) -> Array:
    kinds = {"NaN": np.isnan(pixels), "infinite": np.isinf(pixels), "negative": pixels < 0}
    wrong = [
        f"{int(where.sum())} {kind} (first {PLACE} = {np.argwhere(where)[0].tolist()}: "
        f"{pixels[where][0]:.6g})"
        for kind, where in kinds.items()
        if where.any()
    ]
    if wrong:
        raise VolumeError(f"{path}: radiances that cannot be used: {', '.join(wrong)}")
    return pixels


def _resampled(path: Path, pixels: Array) -> Array:
    """Average over the table's pixels, or repeat where the image is coarser than the table."""
    oiio = imported("OpenImageIO", str(path))

    given = oiio.ImageBuf(np.ascontiguousarray(pixels, dtype=np.float32))
    size = oiio.ROI(0, SKY_COLUMNS, 0, SKY_ROWS, 0, 1, 0, pixels.shape[2])
    result = oiio.ImageBufAlgo.resize(given, filtername="box", roi=size)
    if result.has_error:
        raise VolumeError(f"{path}: cannot be resized: {first_line(result.geterror())}")
    return result.get_pixels(oiio.FLOAT).astype(np.float64)
