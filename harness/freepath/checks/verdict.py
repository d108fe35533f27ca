"""How a check fails: what was measured, what was expected, and how unlikely that is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_HEARD: ContextVar[list[float] | None] = ContextVar("p-values", default=None)


class Failure(AssertionError):
    """What a check found wrong."""


class NotApplicable(Exception):
    """Says why a check cannot be made of this tracker or on this device."""


def demand(holds: object, message: str) -> None:
    """Fail unless something holds; unlike `assert`, also where Python optimises."""
    if not holds:
        raise Failure(message)


def sidak(alpha: float, tests: int) -> float:
    """The level of each of several tests such that all together reject wrongly with `alpha`."""
    return float(-np.expm1(np.log1p(-alpha) / tests))


def chance_of_smallest(p_values: Array) -> float:
    """How likely the smallest of several p-values is so small by chance: what `sidak` inverts."""
    return float(1.0 - (1.0 - np.min(p_values)) ** len(p_values))


@contextmanager
def hearing() -> Iterator[list[float]]:
    """The list of what every `require` inside finds, passed or not: the chance of its smallest."""
    heard: list[float] = []
    before = _HEARD.set(heard)
    try:
        yield heard
    finally:
        _HEARD.reset(before)


def require(
    p_values: Array,
    alpha: float,
    what: str,
    measured: Array | None = None,
    expected: Array | None = None,
) -> None:
    """Fail where the smallest of several p-values is smaller than chance explains.

    `measured` and `expected`, a value for each p-value where there are such, are reported then.
    """
    p_values = np.atleast_1d(p_values)
    level, worst = sidak(alpha, len(p_values)), int(np.argmin(p_values))
    heard = _HEARD.get()
    if heard is not None:
        heard.append(chance_of_smallest(p_values))
    if p_values[worst] >= level:
        return
    # also where it is no number
    text = f"{what}: p = {p_values[worst]:.2g} in part {worst} of {len(p_values)}"
    if measured is not None and expected is not None:
        text += f", measured {measured[worst]:.7g}, expected {expected[worst]:.7g}"
    raise Failure(f"{text}; chance alone explains p of {level:.2g} and more")
