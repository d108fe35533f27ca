"""What users of `recommend` and `try` name: a volume, and a folder for results."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from freepath.errors import UsageError, VolumeError
from freepath.scene.volumes.files import find_file
from freepath.scene.volumes.reading import read_volume


def volume_of(file: Path, sigma_t: float, grid: str | None = None) -> dict[str, Any]:
    """A volume that a user names as a config names it, found where `run` finds those of a config.

    Raises VolumeError where it is none.
    """
    file = find_file(file.absolute() if os.path.lexists(file) else file)
    if not str(file).isprintable():
        raise VolumeError(f"{ascii(str(file))}: expected a name of characters that can be printed")
    if not read_volume(file, grid).densities.any():
        raise VolumeError(f"{file}: is empty: expected a density above 0 in a voxel at least")
    named = {} if grid is None else {"grid": grid}
    return {"file": str(file.resolve()), "sigma_t": sigma_t, **named}


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
        mark.write_text(command, "utf-8")
    except OSError as error:
        raise UsageError(f"{folder}: cannot be a folder for results: {error.strerror}") from error
