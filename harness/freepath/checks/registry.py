"""All checks of a catalog's trackers, in the order of their numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module

from freepath.checks.model import Check
from freepath.compose.catalog import Catalog
from freepath.errors import NothingMatchedError, UsageError

SUITE = (
    *("smoke", "identity", "moments", "random_numbers", "empty_full", "thickness", "majorants"),
    *("geometry", "long_runs", "scattering", "near_light", "absorption", "channels", "counted"),
    "stored",
    "light_moments",
)
"""The modules of `suite`, in the order of their checks."""


def checks(catalog: Catalog) -> list[Check]:
    """Every check; a name is never given twice."""
    modules = (import_module(f"freepath.checks.suite.{name}") for name in SUITE)
    return [check for module in modules for check in module.checks(catalog)]


@dataclass(frozen=True)
class Selection:
    """What -R, -E, -L and -LE say; several of -L must all be found, as with ctest."""

    include: str | None = None
    exclude: str | None = None
    labels: Sequence[str] = ()
    without_labels: Sequence[str] = ()

    def of(self, found: list[Check]) -> list[tuple[int, Check]]:
        """The checks selected, with their numbers from 1 among all.

        Raises UsageError for what is no regular expression, NothingMatchedError where none is left.
        """
        include, exclude = _compiled("-R", self.include), _compiled("-E", self.exclude)
        with_all = [_compiled("-L", label) for label in self.labels]
        without = [_compiled("-LE", label) for label in self.without_labels]
        chosen = [
            (number, check)
            for number, check in enumerate(found, 1)
            if (not include or include.search(check.name))
            and not (exclude and exclude.search(check.name))
            and all(_among(label, check) for label in with_all)
            and not any(_among(label, check) for label in without)
        ]
        if not chosen:
            raise NothingMatchedError(f"no tests matched: the filters leave none of {len(found)}")
        return chosen


def _among(pattern: re.Pattern[str] | None, check: Check) -> bool:
    return bool(pattern) and any(pattern.search(label) for label in check.labels)


def _compiled(flag: str, expression: str | None) -> re.Pattern[str] | None:
    if expression is None:
        return None
    try:
        return re.compile(expression)
    except (re.error, RecursionError, OverflowError) as error:
        message = f"{flag} {expression}: expected a regular expression: {error}"
        raise UsageError(message) from error
