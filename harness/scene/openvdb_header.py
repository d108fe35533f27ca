"""The table of contents of an OpenVDB file."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from freepath.errors import VolumeError

MAGIC = 0x56444220
OLDEST_KNOWN = 222  # the file format of OpenVDB 2.1 (2013) and later


def check_complete(path: Path) -> None:
    """Refuse what is no OpenVDB file, and one that ends before its last grid does.

    OpenVDB itself reads on beyond the end of a truncated file, and may take minutes to stumble over
    what it makes of it. The layout is that of its Archive::readHeader, MetaMap::readMeta and
    GridDescriptor::read.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        try:
            ends = _grid_ends(file, path)
        except struct.error:
            ends = [size + 1]
    if any(end > size for end in ends):
        raise VolumeError(f"{path}: is truncated, its grids go on beyond its end")


def _grid_ends(file: BinaryIO, path: Path) -> list[int]:
    """Return where each grid ends in the file; nothing where the file does not say."""
    beginning = file.read(8)
    if beginning != struct.pack("<q", MAGIC):
        raise VolumeError(f"{path}: is not an OpenVDB file")
    (version,) = _read(file, "I")
    *_, has_offsets = _read(file, "II?")
    if version < OLDEST_KNOWN or not has_offsets:
        return []
    file.seek(36, 1)  # a UUID in letters
    (entries,) = _read(file, "I")
    for _ in range(entries):
        for _ in ("name", "type", "value"):
            _skip_string(file)
    (grids,) = _read(file, "I")
    ends = []
    for _ in range(grids):
        for _ in ("name", "type", "parent"):
            _skip_string(file)
        *_, end = _read(file, "qqq")  # the positions of the grid, of its blocks and of its end
        ends.append(end)
        file.seek(max(end, file.tell()))  # never back, whatever a damaged file says
    return ends


def _read(file: BinaryIO, form: str) -> tuple:
    return struct.unpack(f"<{form}", file.read(struct.calcsize(f"<{form}")))


def _skip_string(file: BinaryIO) -> None:
    (length,) = _read(file, "I")
    file.seek(length, 1)
