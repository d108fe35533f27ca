"""What a user reads when something is wrong, and the exit code that goes with it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from typing import Any

EXCERPT_WIDTH = 100
USAGE = 2
NOTHING_MATCHED = 5
FAILED = 8
INTERRUPTED = 130
PACKAGES = {"vl_convert": "vl-convert-python"}
"""Packages of modules that have another name."""


CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""What commands a terminal, or has a line read in another direction than it is written in."""


def printable(text: str) -> str:
    """A text with nothing in it that would command a terminal; lines and tabs stay."""
    return CONTROL.sub("?", text)


class FreepathError(Exception):
    """A mistake or a failure that is reported as a message, never as a traceback."""

    exit_code = USAGE


@dataclass(frozen=True)
class Problem:
    """One finding in a config: where it is (line and column from 1), what was expected there."""

    file: str
    line: int
    column: int
    path: str
    message: str
    source_line: str = ""

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}:{self.column}: " if self.line else f"{self.file}: "
        text = place + (f"{self.path}: " if self.path else "") + self.message
        if self.source_line:
            shown, caret = _excerpt(self.source_line, self.column - 1)
            text += f"\n    {shown}\n    {' ' * caret}^"
        return text


def _excerpt(line: str, caret: int) -> tuple[str, int]:
    """Return the part of a line around the caret, fit for a terminal, and the caret's place."""
    start = max(0, caret - EXCERPT_WIDTH // 2) if len(line) > EXCERPT_WIDTH else 0
    part = line[start : start + EXCERPT_WIDTH]
    # a tab or an escape sequence would move the caret away from what it points at
    return "".join(c if c.isprintable() else " " for c in part), caret - start


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for the name nearest to a word, or '' where none is near."""
    by_lower = {name.lower(): name for name in names}
    near = get_close_matches(word.lower(), by_lower, n=1)
    return f"; did you mean '{by_lower[near[0]]}'?" if near else ""


class ConfigError(FreepathError):
    """All problems of a config at once."""

    def __init__(self, problems: list[Problem]):
        super().__init__("\n".join(str(problem) for problem in problems))
        self.problems = problems


class UsageError(FreepathError):
    """An argument of the command line that cannot be used."""


def expect(name: str, holds: bool, what: str, got: Any) -> None:
    """Raise UsageError, with the name of an argument, where it is not what was expected."""
    if not holds:
        raise UsageError(f"{name}: expected {what}, got {got!r}")


class CatalogError(FreepathError):
    """A kernel file whose front matter cannot be used."""


class VolumeError(FreepathError):
    """A volume or a file of rays that cannot be read or must be refused."""


class DeviceError(FreepathError):
    """No OpenCL device, or none that matches."""


class MissingPackageError(FreepathError):
    """A package that is needed for some work only, and is not here."""


def imported(module: str, purpose: str) -> Any:
    """Import a package that most work does without; MissingPackageError says what needs it."""
    try:
        return import_module(module)
    except ImportError as error:
        name = PACKAGES.get(module, module)
        told = f"{purpose}: needs {name}, which cannot be imported here ({error})"
        raise MissingPackageError(f"{told}; `pip install {name}`") from error


class NothingMatchedError(FreepathError):
    """The filters left no case."""

    exit_code = NOTHING_MATCHED


class BuildError(FreepathError):
    """A kernel that the device's compiler refused; carries its log."""

    exit_code = FAILED


class ResultError(FreepathError):
    """A folder of results that can no longer be written to while a run goes on."""

    exit_code = FAILED


class RunError(FreepathError):
    """A launch that failed on the device."""

    exit_code = FAILED


class DriverLimitError(RunError):
    """A launch that a driver ended early, by a limit that it has; no fault of the kernel."""
