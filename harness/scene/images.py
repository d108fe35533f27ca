"""Volumes as images: a part of an EXR or a page of a TIFF file for every slice along z."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from freepath.errors import VolumeError, imported
from numpy.typing import NDArray

#: One or three numbers in the header of an EXR file's first part.
VOXEL_SIZE_ATTRIBUTE = "freepath:voxel_size"


def read_slices(path: Path) -> tuple[NDArray, NDArray[np.float64]]:
    """Return densities [z, y, x], in the type they have in the file, and voxels to world (3, 4).

    Integers are not normalised: 255 stays 255. An EXR file may give its voxel size in the
    attribute `freepath:voxel_size`. Raises VolumeError for what is no such image, is cut short, has
    more than one channel or slices of different size or type.
    """
    oiio = imported("OpenImageIO", str(path))

    image = oiio.ImageInput.open(str(path))
    if image is None:
        raise VolumeError(f"{path}: is not an image: {_reason(oiio.geterror())}")
    try:
        kind = image.format_name()
        if kind not in ("openexr", "tiff"):
            # formats of a single image, or whose third dimension OpenImageIO does not read
            raise VolumeError(f"{path}: expected .npy, EXR, TIFF or OpenVDB, got {kind}")
        spacing = _voxel_size(path, image.spec())
        slices = list(_slices(path, image, oiio.UNKNOWN))
    finally:
        image.close()
    if kind == "tiff":
        _check_pages(path)
    return np.stack(slices), np.diag([*spacing, 0.0])[:3]


def _slices(path: Path, image: Any, native: Any) -> Iterator[NDArray]:
    first = None
    number = 0
    while image.seek_subimage(number, 0):
        spec = image.spec()
        if spec.deep or spec.depth > 1:
            raise VolumeError(
                f"{path}: slice {number} is a deep or a 3D image, expected a flat one"
            )
        if spec.nchannels != 1:
            found = f"{spec.nchannels} channels ({', '.join(spec.channelnames)})"
            raise VolumeError(f"{path}: slice {number} has {found}, expected one")
        form = f"{spec.width} x {spec.height} {spec.format}"
        first = first or form
        if form != first:
            raise VolumeError(f"{path}: slice {number} is {form}, the first one {first}")
        pixels = image.read_image(number, 0, 0, 1, native)
        if pixels is None or image.has_error:  # OpenImageIO 3.0 returns what it could read
            raise VolumeError(f"{path}: slice {number} cannot be read: {_reason(image.geterror())}")
        yield pixels[..., 0]
        number += 1


def _voxel_size(path: Path, spec: Any) -> NDArray[np.float64]:
    value = spec.getattribute(VOXEL_SIZE_ATTRIBUTE)
    try:
        size = np.broadcast_to(np.asarray(1.0 if value is None else value, dtype=np.float64), 3)
    except ValueError:
        size = np.zeros(3)
    if not np.all(np.isfinite(size) & (size > 0.0)):
        expected = "expected one or three positive numbers"
        raise VolumeError(f"{path}: {VOXEL_SIZE_ATTRIBUTE}: {expected}, got {value!r}")
    return size


def _reason(message: str) -> str:
    return message.strip().split("\n")[0] or "no reason given"


def _check_pages(path: Path) -> None:
    """Refuse a TIFF whose chain of pages is cut: OpenImageIO would take it for a shorter one.

    TIFF 6.0, section 2: a header with the offset of the first directory, then directories of
    12-byte entries, each with the offset of the next; BigTIFF has wider fields.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        order = "<" if data[:2] == b"II" else ">"
        big = struct.unpack_from(f"{order}H", data, 2)[0] == 43
        offset_format, count_format, entry = ("Q", "Q", 20) if big else ("I", "H", 12)
        try:
            (offset,) = struct.unpack_from(order + offset_format, data, 8 if big else 4)
            while offset:
                (count,) = struct.unpack_from(order + count_format, data, offset)
                after = offset + struct.calcsize(order + count_format) + count * entry
                (offset,) = struct.unpack_from(order + offset_format, data, after)
        except struct.error as error:
            raise VolumeError(f"{path}: is truncated, pages are missing at its end") from error
