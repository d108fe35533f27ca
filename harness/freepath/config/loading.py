"""Find, read and validate a config."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from freepath.config.axes import TRACKER
from freepath.config.base import Kind
from freepath.config.document import Document, Location, path_text, validate
from freepath.config.overrides import Override, parse_all
from freepath.config.sweep import Config
from freepath.errors import ConfigError, Problem, did_you_mean
from freepath.paths import CONFIGS

# no config comes near this; a volume given by mistake is far over it, and parsing it would hang
LARGEST_FILE = 1 << 20


def load(
    path: Path | str | Mapping[str, Any],
    trackers: Mapping[str, type[Kind]],
    overrides: Iterable[str] = (),
) -> Config:
    """Load a config from a file, or from a dictionary of what a file would hold.

    `trackers` are the parameter models of the catalog, by name; `overrides` are texts such as
    "tightness=1,2,4" that replace axes. Raises ConfigError with all problems at once.
    """
    replaced = parse_all(overrides)
    if isinstance(path, Mapping):
        text = json.dumps(_plain(path, ()), ensure_ascii=False)
        document = dataclasses.replace(Document.parse("config", text), text="")
    else:
        document = Document.parse(str(path), read_text(path))
    if document.data is None:
        message = "expected a mapping with name and matrix, got an empty file"
        raise ConfigError([Problem(document.name, 0, 0, "", message)])

    def problem(location: Location, message: str, kind: str = "") -> Problem:
        if location[:1] == ("matrix",) and len(location) > 1 and location[1] in replaced:
            return replaced[str(location[1])].problem(location[2:], message, kind)
        return document.problem(location, message, kind)

    data = _with_overrides(document.data, replaced)
    config = validate(Config, data, problem, {TRACKER: dict(trackers)})
    config.attach(document, frozenset(replaced))
    return config


def _plain(value: Any, location: Location) -> Any:
    """A value as JSON has it: numbers of numpy and paths too; raises ConfigError for others."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one, (*location, str(key))) for key, one in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(one, (*location, place)) for place, one in enumerate(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if value is None or isinstance(value, (str, int, float)):
        return value
    message = f"expected a text, a number, a list or a dictionary, got {type(value).__name__}"
    raise ConfigError([Problem("config", 0, 0, path_text(location), message)])


def _with_overrides(data: Any, replaced: Mapping[str, Override]) -> Any:
    if not replaced or not isinstance(data, dict):
        return data
    matrix = data.get("matrix")
    if matrix is not None and not isinstance(matrix, dict):
        return data
    values = {axis: override.values for axis, override in replaced.items()}
    return {**data, "matrix": {**(matrix or {}), **values}}


def read_text(path: Path | str) -> str:
    """Read a text file in UTF-8; raises ConfigError for whatever is none."""
    try:
        with open(path, "rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except IsADirectoryError:
        raise _unreadable(path, "expected a file, got a directory") from None
    except FileNotFoundError:
        raise _unreadable(path, "expected a file, got nothing there") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise _unreadable(path, f"cannot be read: {reason}") from None
    if len(content) > LARGEST_FILE:
        raise _unreadable(path, "expected a text of at most 1 MiB, got a larger file")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        column = error.start - content.rfind(b"\n", 0, error.start)
        message = f"expected text in UTF-8, got the byte 0x{content[error.start]:02x}"
        raise ConfigError([Problem(str(path), line, column, "", message)]) from None


def _unreadable(path: Path | str, message: str) -> ConfigError:
    return ConfigError([Problem(str(path), 0, 0, "", message)])


def shipped(package_configs: Any = None) -> dict[str, Path]:
    """Return the configs that come with freepath, by name."""
    folder = package_configs or CONFIGS
    return {file.stem: file for file in sorted(Path(str(folder)).rglob("*.yaml"))}


def find(name: Path | str, package_configs: Any = None) -> Path:
    """Return the path of a config: a file, or the name of one that comes with freepath.

    Raises ConfigError with the names there are.
    """
    if os.path.isfile(name):
        return Path(name)
    known = shipped(package_configs)
    for suffix in (".yaml", ".yml"):
        if str(name).removesuffix(suffix) in known:
            return known[str(name).removesuffix(suffix)]
    if os.path.exists(name):
        return Path(name)  # a folder, which load explains, or a pipe, which it reads
    message = "expected a config file or the name of one that comes with freepath"
    message += f" ({', '.join(known)})" if known else ""
    raise _unreadable(name, message + did_you_mean(Path(name).stem, known))
