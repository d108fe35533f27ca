"""Finding the files that a config names."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from freepath.errors import VolumeError

COPIES: dict[str, Path] = {}
"""What is taken in the place of files of these names, which another machine has."""


def find_file(name: str | Path, search_path: Iterable[str | Path] = ()) -> Path:
    """Return the first file of that name in the places where it may be.

    An absolute name (or one with ~) is taken as it is; another is looked for in the folders of
    `search_path` (the config's own), of $FREEPATH_VOLUMES, and in the current folder. Raises
    VolumeError where it is in none of them, is a folder, or cannot be read.
    """
    if str(name) in COPIES:
        return _readable(COPIES[str(name)])
    try:
        wanted = Path(name).expanduser()
    except RuntimeError as error:  # of a ~ with the name of nobody
        raise VolumeError(f"{name}: {error}") from error
    variable = os.environ.get("FREEPATH_VOLUMES", "").split(os.pathsep)
    folders = [*search_path, *filter(None, variable), "."]
    places = [wanted] if wanted.is_absolute() else [Path(folder) / wanted for folder in folders]
    for place in places:
        try:
            if place.exists():
                return _readable(place)
        except (OSError, ValueError) as error:  # a name that is too long, or holds a NUL
            raise VolumeError(f"{name}: cannot be looked for: {error}") from error
    looked = ", ".join(dict.fromkeys(str(place.absolute().parent) for place in places))
    hint = "" if "FREEPATH_VOLUMES" in os.environ else "; FREEPATH_VOLUMES may name more folders"
    raise VolumeError(f"{name}: no such file in {looked}{hint}")


def _readable(path: Path) -> Path:
    if path.is_dir():
        raise VolumeError(f"{path}: is a folder, expected a file")
    if not path.is_file():  # reading a pipe would wait for whoever writes to it
        raise VolumeError(f"{path}: is a pipe or a device, expected a file")
    try:
        with path.open("rb") as file:
            beginning = file.read(1)
    except OSError as error:
        raise VolumeError(f"{path}: cannot be read: {error.strerror}") from error
    if not beginning:
        raise VolumeError(f"{path}: the file is empty")
    return path
