"""Rays from .npy and .csv files."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from freepath.errors import VolumeError
from freepath.scene.media.base import Array
from freepath.scene.volumes.npy import open_npy

COLUMNS = tuple(f"{what}_{axis}" for what in ("origin", "direction") for axis in "xyz")


def read_rays(path: Path) -> tuple[Array, Array]:
    """Return origins and directions (N, 3) from a .npy of shape (N, 6) or a .csv with a header.

    The header names origin_x ... direction_z, in any order. Raises VolumeError with the file and
    the row (of a .npy: from 0; of a .csv: the line) for what is no finite number and for
    directions of length 0.
    """
    if path.suffix.lower() == ".csv":
        table, lines = _read_csv(path)
    elif path.suffix.lower() == ".npy":
        array = open_npy(path)
        if array.ndim != 2 or array.shape[1] != len(COLUMNS):
            raise VolumeError(f"{path}: expected an array of shape (N, 6), got {array.shape}")
        table, lines = np.array(array, dtype=np.float64), range(len(array))
    else:
        raise VolumeError(f"{path}: expected rays in a .npy or a .csv file")
    finite = np.isfinite(table)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        found = table[row, column]
        raise VolumeError(f"{path}: row {lines[row]}: {COLUMNS[column]} is {found}")
    pointless = np.flatnonzero(np.all(table[:, 3:] == 0.0, axis=1))
    if len(pointless):
        raise VolumeError(f"{path}: row {lines[pointless[0]]}: the direction has length 0")
    return table[:, :3], table[:, 3:]


def _read_csv(path: Path) -> tuple[Array, list[int]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, strict=True)
            header = [name.strip() for name in next(reader, [])]
            if sorted(header) != sorted(COLUMNS):
                wanted, found = ", ".join(COLUMNS), ", ".join(header)
                raise VolumeError(f"{path}: row 1: expected the columns {wanted}, got {found}")
            rows = [(reader.line_num, row) for row in reader if row]
    except (csv.Error, UnicodeDecodeError) as error:
        raise VolumeError(f"{path}: is not a .csv file: {error}") from error
    if not rows:
        raise VolumeError(f"{path}: holds no rays")
    order = [header.index(name) for name in COLUMNS]
    numbers = [_numbers(path, line, row) for line, row in rows]
    return np.array(numbers)[:, order], [line for line, _ in rows]


def _numbers(path: Path, line: int, row: list[str]) -> list[float]:
    if len(row) != len(COLUMNS):
        raise VolumeError(f"{path}: row {line}: expected 6 columns, got {len(row)}")
    try:
        if any("_" in cell for cell in row):  # of Python's own numbers
            raise ValueError(f"expected numbers, got {', '.join(row)}")
        return [float(cell) for cell in row]
    except ValueError as error:
        raise VolumeError(f"{path}: row {line}: {error}") from error
