"""When a case has been measured enough. Pure: it looks at times and variances of rounds only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from freepath.stats import relative_half_width

PILOT_ROUNDS = 5
"""Rounds after which the number that the wanted error needs is fixed: stopping as soon as an
estimate looks precise would favour lucky ones."""


@dataclass(frozen=True)
class Rule:
    """What a config's `stop` says."""

    error: float
    """Half-width of the 95 % interval of the RMSE of one sample, relative."""
    time_noise: float
    """Half-width of the 95 % interval of the time of one sample, relative."""
    at_most_s: float
    """Seconds of rounds after which a case stops whatever its precision."""
    samples: int | None = None
    """Exactly this many samples of each ray, instead of the three others."""
    rounds: int = 10
    """How many rounds these are divided into, at least."""


class Stopping:
    """Follows one case round by round."""

    def __init__(self, rule: Rule):
        self.rule = rule
        self._rounds_for_error: int | None = None

    def reason(self, times: Sequence[float], variances: Sequence[float], spent_s: float) -> str:
        """Why to stop after these rounds: "precise", "budget", or "" to go on.

        To be asked after each round: what the pilot rounds say of the error is not asked again.
        """
        if self._rounds_for_error is None and len(times) >= PILOT_ROUNDS:
            self._rounds_for_error = self._planned(variances)
        wanted = self._rounds_for_error
        enough = wanted is not None and len(times) >= wanted
        if enough and relative_half_width(times) <= self.rule.time_noise:
            return "precise"
        return "budget" if spent_s >= self.rule.at_most_s else ""

    def _planned(self, variances: Sequence[float]) -> int:
        """How many rounds the wanted interval of the RMSE takes, from the spread of the pilot's."""
        # The RMSE is the root of the variance: half its relative error.
        half_width = relative_half_width(variances) / 2
        if not math.isfinite(half_width):
            return len(variances)
        return math.ceil(len(variances) * (half_width / self.rule.error) ** 2)
