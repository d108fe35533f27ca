"""Axes replaced from the command line: `-a tightness=1,2,4`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

from freepath.config.axes import AXES
from freepath.config.document import Document, Location, path_text
from freepath.errors import ConfigError, Problem, did_you_mean


@dataclasses.dataclass(frozen=True)
class Override:
    """The values that replace one axis of the matrix."""

    axis: str
    document: Document

    @classmethod
    def parse(cls, text: str) -> Override:
        """Parse AXIS=VALUE[,VALUE...], each value as YAML; raises ConfigError."""
        name = f"-a {text}"
        axis, equals, values = text.partition("=")
        axis = axis.strip()
        if not equals:
            raise _error(name, "", "expected AXIS=VALUE[,VALUE...]")
        if axis not in AXES:
            hint = did_you_mean(axis, AXES) or f"; expected one of {', '.join(AXES)}"
            raise _error(name, "", f"unknown axis '{axis}'{hint}")
        try:
            document = Document.parse(name, f"[{values}]")
            if len(document.data) == 1 and isinstance(document.data[0], list):
                document = Document.parse(name, values)  # brackets of the user's own
        except ConfigError as error:
            raise ConfigError([_placeless(problem, axis) for problem in error.problems]) from None
        return cls(axis, document)

    @property
    def values(self) -> list[Any]:
        """The values as plain Python."""
        return self.document.data

    def problem(self, location: Location, message: str, kind: str = "") -> Problem:
        """Return the problem at a location within the values."""
        return _placeless(self.document.problem(location, message, kind), self.axis)


def parse_all(texts: Iterable[str]) -> dict[str, Override]:
    """Parse all overrides, by axis; raises ConfigError with the problems of all of them."""
    overrides: dict[str, Override] = {}
    problems: list[Problem] = []
    for text in texts:
        try:
            override = Override.parse(text)
        except ConfigError as error:
            problems += error.problems
            continue
        if override.axis in overrides:
            problems.append(
                Problem(f"-a {text}", 0, 0, override.axis, "expected an axis once, got it again")
            )
        overrides[override.axis] = override
    if problems:
        raise ConfigError(problems)
    return overrides


def _error(name: str, path: str, message: str) -> ConfigError:
    return ConfigError([Problem(name, 0, 0, path, message)])


def _placeless(problem: Problem, axis: str) -> Problem:
    # the whole text is in the message already, and its columns are those of no file
    return dataclasses.replace(
        problem, line=0, column=0, source_line="", path=path_text([axis]) + problem.path
    )
