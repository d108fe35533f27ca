"""The axis p_absorb: what it means, and where it is refused."""

from __future__ import annotations

from typing import Any

from freepath.config.axes import ALONG_PATHS, ANALOG, AUTO
from freepath.config.document import Location
from freepath.config.sweep import Config
from freepath.errors import ConfigError, Problem

GRAIN = 2.0**-24
"""Of the uniform numbers of a kernel."""


def refuse_elsewhere(config: Config) -> None:
    """Raise ConfigError where p_absorb is given and no case follows paths.

    Where the axis of estimands is overridden, that is no mistake of the config.
    """
    if "estimand" in config.overridden:
        return
    inherited = set(config.matrix.estimand)
    problems = []
    for i, entry in enumerate(config.include):
        axes = entry.axes()
        estimands = set(axes.get("estimand", config.matrix.estimand))
        if "p_absorb" not in axes:
            inherited |= estimands
        elif _in_vain(axes["p_absorb"], estimands):
            problems.append(_problem(config, ("include", i, "p_absorb"), estimands))
    if _in_vain(config.matrix.p_absorb, inherited):
        problems.append(_problem(config, ("matrix", "p_absorb"), inherited))
    if problems:
        raise ConfigError(problems)


def _in_vain(given: tuple[Any, ...], estimands: set[str]) -> bool:
    return set(given) != {AUTO} and not estimands & set(ALONG_PATHS)


def _problem(config: Config, place: Location, estimands: set[str]) -> Problem:
    message = f"expected an estimand whose paths may be absorbed ({' or '.join(ALONG_PATHS)}), "
    return config.problem(place, message + f"got {', '.join(sorted(estimands))}")


def chance_of_absorption(case: Any) -> float:
    """What a case's p_absorb is, as exactly as the kernel can draw it.

    That of analog paths of several channels is that of the one which scatters most, as of roulette.
    """
    chance = case.p_absorb
    if chance == ANALOG:
        chance = 1.0 - max(case.medium.albedo)
    # a survival that a uniform number cannot tell from another would not be what weights divide by
    return min(round(chance / GRAIN), 1 / GRAIN - 1) * GRAIN


def weights_grow(case: Any) -> bool:
    """Whether a path of a case is absorbed more often than its light is."""
    chosen = case.p_absorb not in (None, AUTO)
    return chosen and chance_of_absorption(case) > 1.0 - max(case.medium.albedo) + GRAIN
