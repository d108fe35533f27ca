"""Environments as images: their radiance by direction, resampled to a small table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from freepath.effects import SKY_COLUMNS, SKY_ROWS
from freepath.errors import VolumeError, imported
from freepath.scene.files import find_file
from freepath.scene.medium import Array
from numpy.typing import NDArray

PLACE = "[row, column, channel]"


@dataclass(frozen=True)
class Sky:
    """Radiance in all directions, as kernels read it: piecewise bilinear in latitude and longitude.

    `table` is (channels, SKY_ROWS + 2, SKY_COLUMNS) float32. Rows are centres of equal steps of
    latitude, from +z down; longitude starts at -x, passes +y, and has +x in the middle. The first
    and last row lie beyond the poles and make all columns meet at a pole in the mean of its row.
    """

    table: NDArray[np.float32]

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
    """Read the image of a light and resample it for a medium of so many channels.

    A grey medium gets the mean over the image's channels, and all channels of another one the only
    channel of a grey image; alpha is left out. Raises VolumeError for a file that is not found, is
    no image of floating-point numbers, has other channels, or a value that is no radiance.
    """
    path = find_file(light.file, search_path)
    pixels = _resampled(path, _checked(path, _read(path)))
    if channels == 1:
        pixels = pixels.mean(axis=2, keepdims=True)
    elif pixels.shape[2] == 1:
        pixels = np.repeat(pixels, channels, axis=2)
    if pixels.shape[2] != channels:
        found = f"the image has {pixels.shape[2]} channels"
        raise VolumeError(f"{path}: {found}, expected 1 or {channels}, as many as the medium")
    with np.errstate(over="ignore"):
        sky = Sky.of(pixels * light.scale)
    if not np.isfinite(sky.table).all():
        raise VolumeError(f"{path}: too large for float32 once multiplied by {light.scale:g}")
    return sky


def _read(path: Path) -> Array:
    """Read the first part of an image file, [rows, columns, channels]."""
    oiio = imported("OpenImageIO", str(path))

    image = oiio.ImageInput.open(str(path))
    if image is None:
        raise VolumeError(f"{path}: is not an image: {_first_line(oiio.geterror())}")
    try:
        spec = image.spec()
        if spec.deep or spec.depth > 1:
            raise VolumeError(f"{path}: is a deep or a 3D image, expected a flat one")
        if str(spec.format) not in ("half", "float", "double"):
            expected = "expected radiances as floating-point numbers (such as EXR or HDR)"
            raise VolumeError(f"{path}: {expected}, got {spec.format}")
        pixels = image.read_image(0, 0, 0, spec.nchannels, oiio.DOUBLE)
        if pixels is None or image.has_error:
            raise VolumeError(f"{path}: cannot be read: {_first_line(image.geterror())}")
    finally:
        image.close()
    return np.delete(pixels, spec.alpha_channel, axis=2) if spec.alpha_channel >= 0 else pixels


def _first_line(message: str) -> str:
    return message.strip().split("\n")[0] or "no reason given"


def _checked(path: Path, pixels: Array) -> Array:
    if not pixels.shape[2]:
        raise VolumeError(f"{path}: has no channel but alpha")
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
        raise VolumeError(f"{path}: cannot be resized: {_first_line(result.geterror())}")
    return result.get_pixels(oiio.FLOAT).astype(np.float64)
