"""NanoVDB files: grids of scalars, also quantised, stored plainly or by zip or blosc.

A file is a row of segments: a header, then for each of its grids metadata and name, then the grids,
each a block of memory. A block holds the grid's own data, a tree, the tree's root with its table,
and nodes, which their parents find by offsets in bytes: upper nodes of 32^3 lower ones, lower nodes
of 16^3 leaves, leaves of 8^3 voxels. All is little-endian, as NanoVDB.h of OpenVDB 10 has it (ABI
32, which later versions keep); the arrays in nodes begin at multiples of 32 bytes.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from freepath.errors import VolumeError, imported
from freepath.scene.volumes.images import check_claim
from freepath.scene.volumes.openvdb_header import Entry, choose
from freepath.scene.volumes.reading import Volume

MAGICS = (b"NanoVDB0", b"NanoVDB1", b"NanoVDB2")
ABI = 32
LEVEL_SET = 1
KINDS = (
    *("unknown", "float", "double", "int16", "int32", "int64", "vec3f", "vec3d", "mask", "half"),
    *("uint32", "bool", "rgba8", "Fp4", "Fp8", "Fp16", "FpN"),
)
TYPES = {
    **{"float": "<f4", "double": "<f8", "int16": "<i2", "int32": "<i4", "int64": "<i8"},
    **{"uint32": "<u4", "Fp4": "<f4", "Fp8": "<f4", "Fp16": "<f4", "FpN": "<f4"},
}
BITS = {"Fp4": 4, "Fp8": 8, "Fp16": 16}
TREE, TYPE = 672, 636
"""Bytes of a grid's memory at which its tree and the number of its type are."""
META = struct.Struct("<4Q2I6d6i3dI4I3I2HI")
CHUNK = 1 << 30
"""Bytes that a blosc chunk stands for; the last one for fewer."""
#: children along a side and voxels along a child's side, as powers of two; where the table begins
LEVELS = ((5, 7, 8256), (4, 3, 1088))
LEAF = 8


class _Damaged(Exception):
    """What cannot be so."""


class _Grid(NamedTuple):
    entry: Entry
    """Its `start` and `end` are the bytes of its block."""
    size: int
    codec: int
    level_set: bool


def read_nanovdb(path: Path, grid: str | None) -> Volume:
    """Return the active box of a grid, chosen as one of an OpenVDB file is.

    Raises VolumeError for what is no such file, is damaged, holds no such grid, or a level set.
    """
    try:
        with path.open("rb") as file:
            grids = list(_listed(file, path.stat().st_size))
            entries = [one.entry for one in grids]
            entry = choose(path, entries, grid)
            chosen = grids[entries.index(entry)]
            if chosen.level_set:
                what = "is a level set, which holds distances: convert it to a fog volume"
                raise VolumeError(f"{path}: grid {entry} {what}")
            check_claim(path, chosen.size // 4, 4)
            tree = _Tree(path, _block(path, file, chosen), entry.kind)
            tree.read()
    except (_Damaged, struct.error, zlib.error, ValueError, OverflowError) as error:
        raise VolumeError(f"{path}: is damaged, or no NanoVDB file: {error}") from error
    first = (int(tree.low[2]), int(tree.low[1]), int(tree.low[0]))
    others = tuple(str(one) for one in entries if one != entry)
    what = f"grid {entry} of {entry.kind}"
    return Volume(path, tree.voxels.T, tree.to_world(), first, what, float(tree.background), others)


def _listed(file: BinaryIO, size: int) -> list[_Grid]:
    """The grids of all segments."""
    found: list[tuple[str, Any]] = []
    while head := file.read(16):
        magic, version, count, _ = struct.unpack("<8sI2H", head)
        if magic not in MAGICS:
            raise _Damaged(f"expected a segment that begins with NanoVDB, got {magic!r}")
        if version >> 21 != ABI:
            raise _Damaged(f"format version {version >> 21}, expected {ABI}")
        metas = []
        for _ in range(count):
            meta = META.unpack(file.read(META.size))
            if meta[21] > size - file.tell():
                raise _Damaged("it ends in the name of a grid")
            name = file.read(meta[21])
            metas.append((name.rstrip(b"\0").decode("utf-8", "replace"), meta))
        start = file.tell()
        for name, meta in metas:
            end = start + meta[1]
            if end > size:
                raise _Damaged("it is truncated, its grids go on beyond its end")
            found.append((name, (*meta, start, end)))
            start = end
        file.seek(start)
    names = [name for name, _ in found]
    return [
        _Grid(
            Entry(
                name,
                names[:place].count(name) if names.count(name) > 1 else None,
                KINDS[meta[4]] if meta[4] < len(KINDS) else f"type {meta[4]}",
                *meta[-2:],
            ),
            meta[0],
            meta[29],
            meta[5] == LEVEL_SET,
        )
        for place, (name, meta) in enumerate(found)
    ]


def _block(path: Path, file: BinaryIO, grid: _Grid) -> bytes:
    """The memory of a grid, unpacked."""
    file.seek(grid.entry.start)
    packed = file.read(grid.entry.end - grid.entry.start)
    if grid.codec == 0:
        block = packed[: grid.size]
    elif grid.codec == 1:
        unzip = zlib.decompressobj()
        block = unzip.decompress(packed[8:], max(1, grid.size))
        block += unzip.decompress(unzip.unconsumed_tail, 1)  # to the end, where the checksum is
        if not unzip.eof:
            raise _Damaged("its zip stream does not end where it should")
    elif grid.codec == 2:
        blosc, parts = imported("imagecodecs", str(path)).blosc_decode, []
        while packed:
            (length,) = struct.unpack_from("<Q", packed)
            parts.append(_unpacked(blosc, packed[8 : 8 + length], grid.size))
            packed = packed[8 + length :]
        block = b"".join(parts)
    else:
        raise _Damaged(f"codec {grid.codec}, expected 0 (none), 1 (zip) or 2 (blosc)")
    if len(block) != grid.size:
        raise _Damaged(f"its grid has {len(block)} bytes, expected {grid.size}")
    return block


def _unpacked(blosc: Any, chunk: bytes, most: int) -> bytes:
    (claimed,) = struct.unpack_from("<I", chunk, 4)
    if claimed > min(most, CHUNK):
        raise _Damaged(f"a chunk claims {claimed} bytes")
    try:
        return blosc(chunk)
    except RuntimeError as error:  # what imagecodecs raises of damaged data
        raise _Damaged(str(error)) from error


class _Tree:
    """The tree in a grid's memory, and the voxels [x, y, z] of its active box."""

    def __init__(self, path: Path, block: bytes, kind: str):
        self._block = np.frombuffer(block, np.uint8)
        self._kind, self._type = kind, np.dtype(TYPES[kind])
        if block[:8] not in MAGICS:
            raise _Damaged(f"expected a grid that begins with NanoVDB, got {block[:8]!r}")
        (number,) = self._take(TYPE, 4).view("<u4")
        if number != KINDS.index(kind):
            raise _Damaged(f"its grid is of type {number}, and said to be of {kind}")
        wide = self._type.itemsize == 8
        self._root = TREE + int(self._take(TREE + 24, 8).view("<u8")[0])
        self._table = self._root + (96 if wide else 64)
        self.low, self.high = self._take(self._root, 24).view("<i4").astype(np.int64).reshape(2, 3)
        (self._count,) = self._take(self._root + 24, 4).view("<u4")
        at = self._root + (32 if wide else 28)
        (self.background,) = self._take(at, self._type.itemsize).view(self._type)
        shape = [int(n) for n in self.high - self.low + 1]
        if min(shape) < 1:
            raise VolumeError(f"{path}: the grid is empty: it has no active voxels")
        check_claim(path, shape[0] * shape[1] * shape[2], self._type.itemsize)
        self.voxels = np.full(shape, self.background, self._type)
        self._covered = 0

    def to_world(self) -> NDArray[np.float64]:
        """Voxels to world (3, 4): NanoVDB's map takes the centre of a voxel, which is its index."""
        matrix = self._take(384, 72).view("<f8").reshape(3, 3)
        offset = self._take(528, 24).view("<f8")
        return np.column_stack([matrix, offset + matrix @ (self.low - 0.5)])

    def read(self) -> None:
        """Fill the box: constant tiles, and voxels of leaves."""
        for number in range(self._count):
            tile = self._take(self._table + 32 * number, 32)
            (key,), (child,) = tile[:8].view("<u8"), tile[8:16].view("<i8")
            parts = [int(key) >> shift & 0x1FFFFF for shift in (42, 21, 0)]
            # 20 bits of each, of a number that may be negative
            origin = np.array([((part << 12) + 2**31) % 2**32 - 2**31 for part in parts])
            if child:
                self._node(self._root + int(child), origin, 0)
            else:
                at = 24 if self._type.itemsize == 8 else 20
                (value,) = tile[at : at + self._type.itemsize].view(self._type)
                self._put(origin, 1 << 12, value)

    def _node(self, at: int, origin: NDArray[np.int64], level: int) -> None:
        """Read what of an upper (level 0) or lower node lies in the box."""
        log, log_child, table = LEVELS[level]
        count, side = 1 << 3 * log, 1 << log_child
        mask = np.unpackbits(self._take(at + 32 + count // 8, count // 8), bitorder="little")
        entries = self._take(at + table, 8 * count)
        children = entries.view("<i8")
        values = entries.view(self._type)[:: 8 // self._type.itemsize]
        place = np.arange(count)
        ijk = np.stack([place >> 2 * log, place >> log, place], axis=1) & ((1 << log) - 1)
        ijk = (ijk << log_child) + origin
        inside = ((ijk <= self.high) & (ijk + side > self.low)).all(axis=1)
        for number in np.flatnonzero(inside & ((mask == 1) | (values != self.background))):
            if not mask[number]:
                self._put(ijk[number], side, values[number])
            elif level == 0:
                self._node(at + int(children[number]), ijk[number], 1)
            else:
                self._put(ijk[number], LEAF, self._leaf(at + int(children[number])))

    def _leaf(self, at: int) -> NDArray:
        """The values of a leaf, [x, y, z]."""
        if not self._kind.startswith("Fp"):
            start = at + (128 if self._type.itemsize == 8 else 96)
            values = self._take(start, LEAF**3 * self._type.itemsize).view(self._type)
            return values.reshape(LEAF, LEAF, LEAF)
        (flags,) = self._take(at + 15, 1)
        bits = BITS.get(self._kind, 1 << min(int(flags) >> 5, 4))
        least, quantum = self._take(at + 80, 8).view("<f4")
        codes = self._take(at + 96, LEAF**3 * bits // 8)
        if bits == 16:
            codes = codes.view("<u2")
        else:
            shifts = np.arange(0, 8, bits, dtype=np.uint8)
            codes = (codes[:, None] >> shifts & np.uint8((1 << bits) - 1)).ravel()
        with np.errstate(over="ignore", invalid="ignore"):
            values = codes.astype(np.float32) * quantum + least
        return values.reshape(LEAF, LEAF, LEAF)

    def _put(self, origin: NDArray[np.int64], side: int, values: Any) -> None:
        """Write a cube of voxels, or of one value, as far as it lies in the box."""
        low = np.maximum(origin, self.low)
        size = np.minimum(origin + side, self.high + 1) - low
        if (size <= 0).any():
            return
        self._covered += int(size.prod())
        if self._covered > self.voxels.size:
            raise _Damaged("its nodes overlap")
        if isinstance(values, np.ndarray):
            values = values[tuple(map(slice, low - origin, low - origin + size))]
        self.voxels[tuple(map(slice, low - self.low, low - self.low + size))] = values

    def _take(self, at: int, count: int) -> NDArray[np.uint8]:
        if not 0 <= at <= len(self._block) - count:
            raise _Damaged("an offset leads out of its grid")
        return self._block[at : at + count]
