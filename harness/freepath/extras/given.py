"""What users of `recommend` and `try` name: a volume, and a folder for results."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from freepath.errors import UsageError, VolumeError
from freepath.results.folder import write
from freepath.scene.volumes.files import find_file
from freepath.scene.volumes.reading import Volume, read_volume

Keys = dict[str, Any]
"""Of a volume, in a config."""


def volume_of(file: Path, sigma_t: float | None, **how: str | None) -> tuple[Volume, Keys]:
    """A volume that a user names, and the keys by which a config names it.

    It is found where `run` finds those of a config; `how` are its `grid` and `raw`. Raises
    VolumeError where it is none.
    """
    file = find_file(file.absolute() if os.path.lexists(file) else file)
    if not str(file).isprintable():
        raise VolumeError(f"{ascii(str(file))}: expected a name of characters that can be printed")
    volume = read_volume(file, **how)
    if not volume.densities.any():
        raise VolumeError(f"{file}: is empty: expected a density above 0 in a voxel at least")
    named = {name: value for name, value in how.items() if value is not None}
    return volume, {"file": str(file.resolve()), "sigma_t": sigma_t or 1.0, **named}


MARK = ".freepath-made"


def own_folder(folder: Path, command: str) -> None:
    """Make a folder, or empty one that the same command made; raises UsageError for any other."""
    mark = folder / MARK
    try:
        held = sorted(folder.iterdir()) if folder.exists() else []
        if held and not (mark.is_file() and mark.read_text("utf-8") == command):
            what = f"or made by `freepath {command}`"
            raise UsageError(f"{folder}: expected a folder that is empty, not there yet, {what}")
        for one in held:
            shutil.rmtree(one) if one.is_dir() and not one.is_symlink() else one.unlink()
        folder.mkdir(parents=True, exist_ok=True)
        write(mark, command)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be a folder for results: {error.strerror}") from error
