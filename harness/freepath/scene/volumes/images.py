"""Volumes as images: a part of an EXR or a page of a TIFF file for every slice along z."""

from __future__ import annotations

import logging
import math
import mmap
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freepath.errors import VolumeError, imported
from freepath.scene.volumes.npy import MOST_VOXELS, first_line

#: One or three numbers in the header of an EXR file's first part.
VOXEL_SIZE_ATTRIBUTE = "freepath:voxel_size"
FORMATS = (
    "expected .npy, EXR, TIFF, OpenVDB (.vdb), NanoVDB (.nvdb), Mitsuba's .vol, pbrt's grid text "
    "(.pbrt), or raw numbers, whose shape `raw` says"
)
TIFF_BEGINNINGS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
SMALL = 1 << 26
"""Bytes that any file may claim to hold."""
MOST_COMPRESSED = 8192
"""Bytes that one byte of a larger file may stand for: eight times what zip can do."""


def read_slices(path: Path) -> tuple[NDArray, NDArray[np.float64]]:
    """Return densities [z, y, x], in the type they have in the file, and voxels to world (3, 4).

    Densities are the numbers in the file: integers are not normalised, whatever their bits, and
    white is a number like others. Parts of an EXR file whose data windows differ lie where these
    say, with 0 around them; its attribute `freepath:voxel_size` may give the voxels' size. Raises
    VolumeError for what is no such image, is cut short, holds fewer slices than it says, or has
    more than one channel or slices of different size or type.
    """
    with path.open("rb") as file:
        beginning = file.read(4)
    if beginning in TIFF_BEGINNINGS:
        return _read_tiff(path), np.eye(3, 4)
    oiio = imported("OpenImageIO", str(path))

    with opened(path) as image:
        kind = image.format_name()
        if kind != "openexr":
            # formats of a single image, or whose third dimension OpenImageIO does not read
            raise VolumeError(f"{path}: {FORMATS}, got {kind}")
        spacing = _voxel_size(path, image.spec())
        slices = _joined(path, list(_parts(path, image, oiio.UNKNOWN)))
    return slices, np.diag([*spacing, 0.0])[:3]


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Open an image by OpenImageIO; VolumeError for what is none, or has a name that is no text."""
    oiio = imported("OpenImageIO", str(path))

    try:
        image = oiio.ImageInput.open(str(path))
        if image is None:
            raise VolumeError(f"{path}: is not an image: {first_line(oiio.geterror())}; {FORMATS}")
        try:
            yield image
        finally:
            image.close()
    except UnicodeDecodeError as error:
        raise VolumeError(f"{path}: is damaged, its header has text that is no UTF-8") from error


def check_claim(path: Path, size: int, unit: int) -> None:
    """Refuse more elements of `unit` bytes than kernels count, or than the file can hold."""
    if size > MOST_VOXELS:
        raise VolumeError(f"{path}: {size} voxels, expected at most {MOST_VOXELS}")
    there = path.stat().st_size
    if size * unit > max(SMALL, there * MOST_COMPRESSED):
        what = f"it claims {size * unit / 2**30:.3g} GiB in a file of {there} bytes"
        raise VolumeError(f"{path}: is damaged, or nearly empty: {what}; crop it")


def pixels_of(path: Path, image: Any, part: int, kind: Any) -> NDArray:
    """Return all pixels of a part [y, x, channel] as OpenImageIO's type `kind`."""
    spec = image.spec()
    if spec.deep or spec.depth > 1:
        raise VolumeError(f"{path}: part {part} is a deep or a 3D image, expected a flat one")
    check_claim(path, spec.width * spec.height * spec.nchannels, spec.format.size())
    pixels = image.read_image(part, 0, 0, spec.nchannels, kind)
    if pixels is None or image.has_error:  # OpenImageIO 3.0 returns what it could read
        reason = first_line(image.geterror())
        raise VolumeError(f"{path}: part {part} cannot be read: {reason}")
    return pixels


def _parts(path: Path, image: Any, native: Any) -> Iterator[tuple[tuple[int, int], NDArray]]:
    """The place (y, x) and the pixels of each part."""
    first, number, claimed = None, 0, 0
    while image.seek_subimage(number, 0):
        spec = image.spec()
        claimed += spec.width * spec.height
        check_claim(path, claimed, spec.format.size())
        if spec.nchannels != 1:
            found = f"{spec.nchannels} channels ({', '.join(spec.channelnames)})"
            raise VolumeError(f"{path}: slice {number} has {found}, expected one")
        first = first or str(spec.format)
        if str(spec.format) != first:
            raise VolumeError(f"{path}: slice {number} is {spec.format}, the first one {first}")
        yield (spec.y, spec.x), pixels_of(path, image, number, native)[..., 0]
        number += 1


def _joined(path: Path, parts: list[tuple[tuple[int, int], NDArray]]) -> NDArray:
    """Stack parts in the union of their data windows."""
    low = np.min([place for place, _ in parts], axis=0)
    high = np.max([np.add(place, pixels.shape) for place, pixels in parts], axis=0)
    shape = (len(parts), *(int(size) for size in high - low))
    kind = parts[0][1].dtype
    check_claim(path, math.prod(shape), kind.itemsize)
    slices = np.zeros(shape, dtype=kind)
    for whole, (place, pixels) in zip(slices, parts, strict=True):
        y, x = place - low
        whole[y : y + pixels.shape[0], x : x + pixels.shape[1]] = pixels
    return slices


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


def _read_tiff(path: Path) -> NDArray:
    import tifffile

    _check_pages(path)
    try:
        with _no_error_logged("tifffile"), tifffile.TiffFile(path) as file:
            pages = list(file.pages)
            for number, page in enumerate(pages):
                _check_page(path, number, page, pages[0])
            promised = _promised(path, pages[0])
            check_claim(path, max(promised, len(pages)) * pages[0].size, pages[0].dtype.itemsize)
            if len(pages) == 1 and promised > 1:
                # beyond 4 GB ImageJ writes all slices one after the other behind one directory
                slices = file.series[0].asarray().reshape(-1, *pages[0].shape)
            else:
                slices = np.stack([page.asarray() for page in pages])
    except VolumeError:
        raise
    except Exception as error:  # whatever a library makes of a damaged file
        raise VolumeError(f"{path}: cannot be read: {first_line(error)}") from error
    if len(slices) < promised:
        found = f"its description promises {promised} slices, {len(slices)} are there"
        raise VolumeError(f"{path}: {found}")
    return slices


@contextmanager
def _no_error_logged(name: str) -> Iterator[None]:
    """Raise what a library logs as an error: tifffile goes on without a tag that it cannot read."""
    logged: list[str] = []
    handler = logging.Handler(logging.WARNING)  # warnings are kept from the screen
    handler.emit = lambda record: logged.extend(
        [record.getMessage()] * (record.levelno >= logging.ERROR)
    )
    logger = logging.getLogger(name)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
    if logged:
        raise ValueError(logged[0])


def _check_page(path: Path, number: int, page: Any, first: Any) -> None:
    channels = page.samplesperpixel
    if channels != 1 or page.photometric not in (None, 0, 1):  # white or black is the least
        colours = getattr(page.photometric, "name", page.photometric)
        raise VolumeError(f"{path}: slice {number} has {channels} channels ({colours}), expected 1")
    if page.dtype is None or page.dtype.kind not in "buif" or len(page.shape) != 2:
        what = f"{page.bitspersample} bits of format {page.sampleformat}, shape {page.shape}"
        raise VolumeError(f"{path}: slice {number} has {what}; expected a flat image of numbers")
    form, wanted = (
        f"{p.imagewidth} x {p.imagelength} {p.dtype} of {p.bitspersample} bits"
        for p in (page, first)
    )
    if form != wanted:
        raise VolumeError(f"{path}: slice {number} is {form}, the first one {wanted}")


def _promised(path: Path, page: Any) -> int:
    """How many slices a TIFF file says it has: ImageJ's, OME's or tifffile's words, or a tag."""
    text = page.description
    numbers = page.tags.valueof(297, default=(0, 0))  # PageNumber: this one, of so many
    promised = int(numbers[1]) if len(numbers) == 2 else 0
    sizes = dict(re.findall(r'\bSize([ZCT])="(\d+)"', text))
    if text.startswith("ImageJ="):
        sizes = dict(re.findall(r"^(images|channels)=(\d+)", text, re.MULTILINE))
        sizes["C"] = sizes.pop("channels", "1")
        promised = max(promised, int(sizes.get("images", 1)))
    elif sizes:
        promised = max(promised, math.prod(map(int, sizes.values())))
    elif shape := re.search(r'"shape": \[([\d, ]+)\]', text):
        promised = math.prod(int(size) for size in shape[1].split(",")) // page.size
    if int(sizes.get("C", 1)) > 1:
        raise VolumeError(f"{path}: its description promises {sizes['C']} channels, expected one")
    return promised


def _check_pages(path: Path) -> None:
    """Refuse a TIFF whose chain of pages is cut: readers would take it for a shorter one.

    TIFF 6.0, section 2: a header with the offset of the first directory, then directories of
    12-byte entries, each with the offset of the next; BigTIFF has wider fields.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        order = "<" if data[:2] == b"II" else ">"
        big = struct.unpack_from(f"{order}H", data, 2)[0] == 43
        offset_format, count_format, entry = ("Q", "Q", 20) if big else ("I", "H", 12)
        seen: set[int] = set()
        try:
            (offset,) = struct.unpack_from(order + offset_format, data, 8 if big else 4)
            if not offset:
                raise VolumeError(f"{path}: is not an image: a TIFF file without a page")
            while offset:
                if offset in seen:
                    raise VolumeError(f"{path}: is damaged, its pages go round in a circle")
                seen.add(offset)
                (count,) = struct.unpack_from(order + count_format, data, offset)
                after = offset + struct.calcsize(order + count_format) + count * entry
                (offset,) = struct.unpack_from(order + offset_format, data, after)
        except (struct.error, OverflowError) as error:
            raise VolumeError(f"{path}: is truncated, pages are missing at its end") from error
