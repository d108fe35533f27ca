"""OpenVDB files, read in a process of a Python that can."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freepath.errors import VolumeError
from freepath.scene.volumes import openvdb_reader
from freepath.scene.volumes.images import MOST_COMPRESSED, SMALL
from freepath.scene.volumes.npy import MOST_VOXELS
from freepath.scene.volumes.openvdb_header import Entry, background, choose, contents
from freepath.scene.volumes.reading import Volume

SYSTEM_PYTHON = "/usr/bin/python3"
HOW_TO_INSTALL = (
    "nothing here reads OpenVDB: install Debian's python3-openvdb or python3-openimageio "
    "(apt install python3-openvdb)"
)
SECONDS, SECONDS_PER_MIB = 8, 30
"""Of a processor, that a reader may take; of the clock, on a busy machine, WAIT times as many."""
WAIT = 10
MEMORY = 3 << 29
"""Bytes of address space that a reader takes before it has read anything, and more than that."""


def read_openvdb(path: Path, grid: str | None) -> Volume:
    """Return a grid's active box, with what the library warned of.

    By OpenVDB's own module or an OpenImageIO that reads OpenVDB, of this Python or the system's, in
    a process with limits of memory and time. Raises VolumeError where nothing reads the file, or
    where it or the grid cannot be used.
    """
    grids = contents(path)
    size = path.stat().st_size
    entry = Entry("density" if grid is None else grid, None, "unknown type", 0, size)
    if grids is not None:
        entry = choose(path, grids, grid)
    readers: set[str] = set()
    for python in interpreters():
        voxels, answer, words = _read_there(python, path, entry)
        if voxels is not None:
            break
        readers.update(answer["unread"])
    else:
        what = f"grid {entry} is of {entry.kind}, which {' and '.join(sorted(readers))} cannot read"
        raise VolumeError(f"{path}: {what if readers else HOW_TO_INSTALL}")
    matrix = np.asarray(answer["transform"], dtype=np.float64)
    # OpenVDB multiplies row vectors; its indices are voxel centres, ours their lower corners
    to_world = matrix[:, :3].T.copy()
    to_world[:, 3] += to_world[:, :3] @ (np.asarray(answer["minimum"]) - 0.5)
    return Volume(
        path,
        voxels,
        to_world,
        tuple(int(i) for i in reversed(answer["minimum"])),
        f"grid {entry} of {entry.kind}",
        background(path, entry) if answer["background"] is None else answer["background"],
        tuple(str(one) for one in grids or () if one != entry),
        f"OpenVDB says: {words}" if words else "",
    )


def interpreters() -> list[str]:
    """Return the Pythons that may have a reader, to be tried in this order."""
    import OpenImageIO as oiio

    own = any(importlib.util.find_spec(name) for name in ("openvdb", "pyopenvdb"))
    own = own or "openvdb" in oiio.get_string_attribute("format_list").split(",")
    found = [sys.executable] if own else []
    return [*found, SYSTEM_PYTHON] if os.access(SYSTEM_PYTHON, os.X_OK) else found


def _read_there(python: str, path: Path, entry: Entry) -> tuple[NDArray | None, Any, str]:
    """Return densities, the reader's answer, and what libraries said meanwhile."""
    size = path.stat().st_size
    dense = min(max(SMALL, size * MOST_COMPRESSED), 8 * MOST_VOXELS)
    seconds = math.ceil(SECONDS + SECONDS_PER_MIB * size / 2**20)
    late = f"{path}: cannot be read: that took more than {seconds} s for {size} bytes"
    with tempfile.TemporaryDirectory(prefix="freepath-") as folder:
        names = {name: os.path.join(folder, f"{name}.json") for name in ("request", "answer")}
        request = {
            "path": str(path.absolute()),
            "name": entry.name,
            "place": entry.count,
            "kind": entry.kind,
            "span": (entry.start, entry.end),
            "most": (MOST_VOXELS, dense // 4),
            "seconds": seconds,
            "memory": MEMORY + 3 * dense,
            "output": os.path.join(folder, "densities.npy"),
            "answer": names["answer"],
        }
        Path(names["request"]).write_text(json.dumps(request))
        # -I: what points this Python at its packages must not mislead another one
        command = [python, "-I", openvdb_reader.__file__, names["request"]]
        # threads reserve address space, which is limited
        environment = os.environ | {"MALLOC_ARENA_MAX": "1", "OPENBLAS_NUM_THREADS": "1"}
        try:
            done = subprocess.run(
                command,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                check=False,
                timeout=WAIT * seconds,
                env=environment,
            )
        except subprocess.TimeoutExpired as error:
            raise VolumeError(late) from error
        if done.returncode == -signal.SIGXCPU:
            raise VolumeError(late)
        lines = re.sub(r"\x1b\[[0-9;]*m", "", done.stdout).splitlines()
        words = ["".join(c for c in line if c.isprintable()).strip() for line in lines]
        words = [word for word in words if word]
        if done.returncode:
            why = f"{python} failed with status {done.returncode}"
            why = words[-1] if words and done.returncode > 0 else why
            raise VolumeError(f"{path}: cannot be read: {why}")
        answer = json.loads(Path(names["answer"]).read_text())
        if "refused" in answer:
            raise VolumeError(f"{path}: {answer['refused']}")
        voxels = None if "unread" in answer else np.load(request["output"])
        return voxels, answer, "; ".join(dict.fromkeys(words))
