"""The table of contents of an OpenVDB file."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from freepath.errors import VolumeError

MAGIC = 0x56444220
OLDEST_KNOWN = 222  # the file format of OpenVDB 2.1 (2013) and later
SCALARS = ("float", "double", "half", "int32", "int64")
SCALARS += ("int16", "uint32", "Fp4", "Fp8", "Fp16", "FpN")  # of NanoVDB alone
VALUES = {"float": "f", "double": "d", "int32": "i", "int64": "q"}
MAP_BYTES = dict.fromkeys(("ScaleMap", "UniformScaleMap"), 120)
MAP_BYTES |= dict.fromkeys(("ScaleTranslateMap", "UniformScaleTranslateMap"), 144)
MAP_BYTES |= {"TranslationMap": 24, "AffineMap": 128, "UnitaryMap": 128}
"""How many bytes a transform has in a file."""
LONGEST = 1 << 26
"""Bytes of a text, or of what else a file says of a grid."""
COUNT_MARK = "\x1e"  # between a name and the count of those that are the same


class Entry(NamedTuple):
    """A grid: its name, its place among those of the same name, the type of its values."""

    name: str
    count: int | None
    kind: str
    start: int
    end: int

    @property
    def shown(self) -> str:
        """What a config calls it."""
        return f"{self.name}[{self.count}]" if self.count else self.name

    @property
    def unique(self) -> str:
        """What OpenVDB calls it."""
        return self.name if self.count is None else f"{self.name}[{self.count}]"

    def __str__(self) -> str:
        shown = "".join(c if c.isprintable() else "?" for c in self.shown)
        name = shown or "'' (nameless)"
        return name if self.kind in SCALARS else f"{name} (of {self.kind})"


def contents(path: Path) -> list[Entry] | None:
    """Return the grids of a file; None where it does not say where they are.

    Refuses what is no OpenVDB file, and one that ends before its last grid does: OpenVDB itself
    reads on beyond the end of a truncated file, and may take minutes to stumble over what it makes
    of it. The layout is that of its Archive::readHeader, MetaMap::readMeta and
    GridDescriptor::read.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        try:
            grids = _entries(file, path)
        except (struct.error, OSError, OverflowError):
            grids = [Entry("", None, "", 0, size + 1)]
    if any(not 0 <= grid.start <= grid.end <= size for grid in grids or ()):
        raise VolumeError(f"{path}: is truncated, its grids go on beyond its end")
    return grids


def background(path: Path, entry: Entry) -> float | None:
    """Return what a grid's tree says is outside of it; None where this does not find it.

    The layout is that of OpenVDB's Archive::readGrid: compression, metadata, transform, tree.
    """
    if entry.kind not in VALUES:
        return None
    with path.open("rb") as file:
        try:
            file.seek(entry.start + 4)
            (count,) = _read(file, "I")
            for _ in range(count):
                _string(file), _string(file)  # name and type
                _string(file)  # the value, which begins with its size
            file.seek(MAP_BYTES[_string(file)] + 4, 1)  # and how many buffers a voxel has
            return float(_read(file, VALUES[entry.kind])[0])
        except (struct.error, KeyError, OSError, OverflowError):
            return None


def choose(path: Path, grids: list[Entry], wanted: str | None) -> Entry:
    """Return the grid `wanted`, or the one called density, or the only grid of scalars."""
    scalars = [grid for grid in grids if grid.kind in SCALARS]
    listed = ", ".join(sorted(map(str, scalars))) or "none"
    named = [grid for grid in grids if wanted in (grid.shown, grid.unique)]
    if wanted is None:
        named = [grid for grid in grids if grid.name == "density"] or scalars
        if not scalars:
            all_of_them = ", ".join(map(str, grids)) or "it is empty"
            raise VolumeError(f"{path}: it holds no grid of scalars: {all_of_them}")
    if len(named) > 1:
        raise VolumeError(f"{path}: it holds several grids, choose one of: {listed}")
    if not named or named[0].kind not in SCALARS:
        what = f"{str(named[0])!r} is no grid of scalars" if named else ""
        what = what or f"there is no grid {wanted!r} of scalars"
        raise VolumeError(f"{path}: {what}, expected one of: {listed}")
    return named[0]


def _entries(file: BinaryIO, path: Path) -> list[Entry] | None:
    beginning = file.read(8)
    if beginning != struct.pack("<q", MAGIC):
        raise VolumeError(f"{path}: is not an OpenVDB file")
    (version,) = _read(file, "I")
    *_, has_offsets = _read(file, "II?")
    if version < OLDEST_KNOWN or not has_offsets:
        return None
    file.seek(36, 1)  # a UUID in letters
    (entries,) = _read(file, "I")
    for _ in range(entries):
        for _ in ("name", "type", "value"):
            _string(file)
    (count,) = _read(file, "I")
    grids: list[Entry] = []
    for _ in range(count):
        name, kind, _ = (_string(file) for _ in ("name", "type", "parent"))
        # the positions of the grid, of its blocks and of its end
        start, _, end = _read(file, "qqq")
        name, _, place = name.partition(COUNT_MARK)
        value = kind.removeprefix("Tree_").split("_")[0]
        grids.append(Entry(name, int(place) if place.isdecimal() else None, value, start, end))
        file.seek(max(end, file.tell()))  # never back, whatever a damaged file says
    return grids


def _read(file: BinaryIO, form: str) -> tuple[Any, ...]:
    return struct.unpack(f"<{form}", file.read(struct.calcsize(f"<{form}")))


def _string(file: BinaryIO) -> str:
    (length,) = _read(file, "I")
    text = file.read(min(length, LONGEST))
    if len(text) < length:
        raise struct.error
    return text.decode("utf-8", "replace")
