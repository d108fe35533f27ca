"""OpenVDB files, in this process or in one of the system's Python."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from freepath.errors import VolumeError
from freepath.scene import openvdb_reader
from freepath.scene.openvdb_header import check_complete
from numpy.typing import NDArray

SYSTEM_PYTHON = "/usr/bin/python3"
HOW_TO_INSTALL = (
    "nothing here reads OpenVDB: install Debian's python3-openvdb or python3-openimageio "
    "(apt install python3-openvdb)"
)


def read_openvdb(
    path: Path, grid: str | None
) -> tuple[NDArray, NDArray[np.float64], tuple[int, int, int]]:
    """Return the densities of a grid's active box, voxels to world (3, 4), and its first index.

    Densities and index are [z, y, x]. By OpenImageIO where its build reads OpenVDB; otherwise by
    Debian's python3-openvdb or python3-openimageio in a process of the system's Python. Raises
    VolumeError where nothing reads OpenVDB, or where the file or the grid cannot be used.
    """
    check_complete(path)
    found = _read_here(path, grid)
    for python in interpreters():
        found = found or _read_there(python, path, grid)
    if found is None:
        raise VolumeError(f"{path}: {HOW_TO_INSTALL}")
    densities, transform, minimum = found
    matrix = np.asarray(transform, dtype=np.float64)
    # OpenVDB multiplies row vectors; its indices are voxel centres, ours their lower corners
    to_world = matrix[:, :3].T.copy()
    to_world[:, 3] += to_world[:, :3] @ (np.asarray(minimum) - 0.5)
    return densities, to_world, tuple(int(i) for i in reversed(minimum))


def interpreters() -> list[str]:
    """Return the Pythons that may have a reader, to be tried in this order."""
    own = [name for name in ("openvdb", "pyopenvdb") if importlib.util.find_spec(name)]
    found = [sys.executable] if own else []
    return [*found, SYSTEM_PYTHON] if os.access(SYSTEM_PYTHON, os.X_OK) else found


def _read_here(path: Path, grid: str | None) -> tuple | None:
    try:
        return openvdb_reader.read_with_openimageio(str(path), grid)
    except openvdb_reader.Refused as refused:
        raise VolumeError(f"{path}: {refused}") from refused


def _read_there(python: str, path: Path, grid: str | None) -> tuple | None:
    with tempfile.TemporaryDirectory(prefix="freepath-") as folder:
        output = os.path.join(folder, "densities.npy")
        # -I: what points this Python at its packages must not mislead another one
        command = [python, "-I", openvdb_reader.__file__, str(path), grid or "", output]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            why = f"{python} failed with status {done.returncode}"
            last = (done.stderr.strip().splitlines() or [why])[-1]
            raise VolumeError(f"{path}: cannot be read: {last}")
        answer = json.loads(done.stdout.splitlines()[-1])
        if "refused" in answer:
            raise VolumeError(f"{path}: {answer['refused']}")
        if "no_reader" in answer:
            return None
        return np.load(output), answer["transform"], answer["minimum"]
