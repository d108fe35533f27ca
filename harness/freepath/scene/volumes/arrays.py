"""Volumes that are one array of numbers behind a short header: raw, Mitsuba's .vol, pbrt's text."""

from __future__ import annotations

import math
import re
import struct
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from freepath.errors import VolumeError
from freepath.scene.volumes.npy import MOST_VOXELS, first_line
from freepath.scene.volumes.reading import Volume

VOL_TYPES = {1: "<f4", 3: "u1"}
"""Types by the number that stands for them in a .vol file; Mitsuba reads and writes no others."""
NAME = re.compile(r'\s*"[^"\n]*"')
PARAMETER = re.compile(r'\s*"\s*\w+\s+(\w+)\s*"\s*(\[[^\]]*\]|"[^"\n]*"|[^\s"\[\]]+)')
MOVED = re.compile(
    r"^\s*(Transform|ConcatTransform|Scale|Translate|Rotate|LookAt|CoordSysTransform|Include)\b",
    re.MULTILINE,
)


def read_raw(path: Path, raw: str) -> Volume:
    """Read numbers without a header, x fastest, as a config's `raw` says: '8x9x10 uint16 big'.

    Raises VolumeError where the file is longer or shorter than that.
    """
    shape, kind, *order = raw.split()
    counts = tuple(int(n) for n in reversed(shape.split("x")))
    dtype = np.dtype(kind).newbyteorder(">" if order == ["big"] else "<")
    claimed, there = math.prod(counts) * dtype.itemsize, path.stat().st_size
    if claimed != there:
        raise VolumeError(f"{path}: {raw} takes {claimed} bytes, the file has {there}")
    return Volume(path, _mapped(path, dtype, counts, 0), np.eye(3, 4))


def read_vol(path: Path) -> Volume:
    """Read Mitsuba's .vol, version 3, of one channel: its box is that in the file.

    A header of 48 bytes: VOL, the version, type, voxels along x, y, z, channels, and the two
    corners of the box; then the numbers, x fastest. Mitsuba itself puts the box into a unit cube,
    unless `use_grid_bbox` is set. Raises VolumeError for anything else.
    """
    with path.open("rb") as file:
        head = file.read(48)
    if len(head) < 48 or head[:4] != b"VOL\3":
        raise VolumeError(f"{path}: expected a volume of Mitsuba, format version 3")
    kind, nx, ny, nz, channels, *box = struct.unpack("<5i6f", head[4:])
    if kind not in VOL_TYPES or channels != 1:
        expected = "expected float32 (1) or uint8 (3) in one channel"
        raise VolumeError(f"{path}: type {kind} in {channels} channels, {expected}")
    densities = _mapped(path, np.dtype(VOL_TYPES[kind]), (nz, ny, nx), 48)
    beyond = path.stat().st_size - 48 - densities.nbytes
    remark = f"{beyond} bytes behind its voxels are not used" if beyond else ""
    return Volume(path, densities, _in_box(path, box, (nx, ny, nz)), remark=remark)


def read_pbrt(path: Path) -> Volume:
    """Read the `density` of the one medium in pbrt's text: "uniformgrid", or "heterogeneous" of v3.

    The box is `p0` to `p1`. Raises VolumeError for several media or none, a list that is no
    density of nx x ny x nz numbers, and where a transform before the medium would move its box.
    """
    try:
        text = re.sub(r"#[^\n]*", "", path.read_bytes().decode("utf-8"))
    except UnicodeDecodeError as error:
        raise VolumeError(f"{path}: is no text: {first_line(error)}") from error
    before, *media = re.split(r"\bMakeNamedMedium\b", text)
    if len(media) != 1:
        raise VolumeError(f"{path}: {len(media)} named media, expected one")
    if moved := MOVED.search(before):
        what = f"{moved[1]} before the medium, which is not followed here"
        raise VolumeError(f"{path}: {what}: leave it out, or give voxel_size")
    found: dict[str, str] = {}
    place = NAME.match(media[0])
    while place and (place := PARAMETER.match(media[0], place.end())):
        found[place[1]] = place[2]
    kind = found.get("type", "").strip('[]" ')
    if kind not in ("uniformgrid", "heterogeneous"):
        expected = 'expected "uniformgrid" (of pbrt 3, "heterogeneous")'
        raise VolumeError(f"{path}: a medium of type {kind!r}, {expected}")
    counts = [_numbers(path, found, name, 1, "1") for name in ("nx", "ny", "nz")]
    nx, ny, nz = (int(one[0]) if one[0] > 0 and one[0].is_integer() else 0 for one in counts)
    densities = _numbers(path, found, "density", nx * ny * nz).reshape(nz, ny, nx)
    box = [
        *_numbers(path, found, "p0", 3, "0 0 0"),
        *_numbers(path, found, "p1", 3, "1 1 1"),
    ]
    used = ("type", "nx", "ny", "nz", "p0", "p1", "density")
    left = ", ".join(name for name in found if name not in used)
    remark = f"not used: {left}" if left else ""
    return Volume(path, densities, _in_box(path, box, (nx, ny, nz)), remark=remark)


def _numbers(
    path: Path, found: dict[str, str], name: str, count: int, default: str = ""
) -> NDArray[np.float64]:
    """The numbers of a parameter of pbrt's, as many as there must be."""
    value = found.get(name, default).strip("[] \n\t")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            numbers = np.fromstring(value, sep=" ") if value else np.empty(0)
        except (DeprecationWarning, ValueError) as error:
            raise VolumeError(f"{path}: {name} is no list of numbers") from error
    if len(numbers) != count or not count:
        raise VolumeError(f"{path}: {len(numbers)} numbers in {name}, expected {count or 'more'}")
    return numbers


def _mapped(path: Path, dtype: np.dtype, shape: tuple[int, ...], start: int) -> NDArray:
    """The array that begins at a byte of a file; VolumeError where it is not all there."""
    count = math.prod(shape)
    if min(shape) < 1 or count > MOST_VOXELS:
        raise VolumeError(f"{path}: {count} voxels, expected 1 to {MOST_VOXELS}")
    missing = start + count * dtype.itemsize - path.stat().st_size
    if missing > 0:
        raise VolumeError(f"{path}: is truncated, {missing} bytes of its array are missing")
    return np.memmap(path, dtype, "r", start, shape)


def _in_box(path: Path, box: list[float], counts: tuple[int, ...]) -> NDArray[np.float64]:
    """Voxels to world (3, 4), of voxels (x, y, z) that fill a box of two corners."""
    low, high = np.reshape(np.asarray(box, dtype=np.float64), (2, 3))
    if not (np.isfinite(box).all() and (high > low).all()):
        raise VolumeError(
            f"{path}: its box is {low.tolist()} to {high.tolist()}, expected a volume"
        )
    return np.column_stack([np.diag((high - low) / counts), low])
