"""Arrays that are expensive to compute, kept in the user's cache folder between runs."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_writing = ContextVar("writing", default=True)


@contextlib.contextmanager
def reading_only() -> Iterator[None]:
    """Keep nothing more meanwhile: for what will not be asked for again."""
    before = _writing.set(False)
    try:
        yield
    finally:
        _writing.reset(before)


def cache_dir() -> Path:
    """Return the folder of the cache: $FREEPATH_CACHE, else the user's cache folder."""
    chosen = os.environ.get("FREEPATH_CACHE")
    if chosen:
        return Path(chosen)
    import platformdirs

    return Path(platformdirs.user_cache_dir("freepath"))


def cached(name: str, compute: Callable[[], NDArray]) -> NDArray:
    """Return the array kept under `name`, or compute and keep it.

    `name` must say everything that the array depends on. A file that is damaged or was not written
    by this function is made anew; a cache that cannot be written is done without.
    """
    path = cache_dir() / f"{name}.npy"
    array = _load(path, name)
    if array is None:
        array = compute()
        if _writing.get():
            with contextlib.suppress(OSError):
                _store(path, name, array)
    return array


def _seal(name: str, array: NDArray) -> bytes:
    digest = hashlib.sha256(f"{name} {array.dtype.str} {array.shape}".encode())
    digest.update(array.data)
    return digest.digest()


def _load(path: Path, name: str) -> NDArray | None:
    try:
        with path.open("rb") as file:
            array = np.load(file, allow_pickle=False)
            seal = file.read()
    except (OSError, ValueError, EOFError, MemoryError):
        return None
    genuine = isinstance(array, np.ndarray) and array.flags.c_contiguous
    return array if genuine and seal == _seal(name, array) else None


def _store(path: Path, name: str, array: NDArray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            np.save(file, array)
            file.write(_seal(name, array))  # readers of .npy do not look beyond the array
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise
