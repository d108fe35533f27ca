"""Opening .npy files without trusting them."""

from __future__ import annotations

import tokenize
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from freepath.errors import VolumeError

MOST_VOXELS = 2**31 - 1  # kernels count voxels in 32 bits
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def open_npy(path: Path) -> NDArray:
    """Return the array of real numbers in a .npy file, mapped into memory.

    Raises VolumeError where the file is none, is cut short, holds no numbers or no elements.
    """
    try:
        with path.open("rb") as file:
            version = np.lib.format.read_magic(file)
            if version not in _HEADERS:
                raise VolumeError(f"{path}: holds records, expected an array of real numbers")
            shape, _, dtype = _HEADERS[version](file)
            start = file.tell()
            size = file.seek(0, 2)
    except (ValueError, EOFError, OSError, SyntaxError, tokenize.TokenError, TypeError) as error:
        raise VolumeError(f"{path}: is not a .npy file: {first_line(error)}") from error
    if any(type(size) is not int or size < 0 for size in shape):  # True is an int to numpy
        raise VolumeError(f"{path}: is damaged, its shape is {shape}")
    if dtype.kind not in "buif":
        what = "Python objects (pickled)" if dtype.hasobject else f"elements of type {dtype}"
        raise VolumeError(f"{path}: holds {what}, expected real numbers")
    count = int(np.prod(shape, dtype=object))
    if count == 0:
        raise VolumeError(f"{path}: is empty, its shape is {shape}")
    missing = count * dtype.itemsize - (size - start)
    if missing > 0:
        raise VolumeError(f"{path}: is truncated, {missing} bytes of its array are missing")
    return np.lib.format.open_memmap(path, mode="r")


def first_line(error: Exception | str) -> str:
    """Return the first line of what a library says, or that it says nothing."""
    lines = str(error).strip().splitlines() or [
        type(error).__name__ if error else "no reason given"
    ]
    return lines[0]
