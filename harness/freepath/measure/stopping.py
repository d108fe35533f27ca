"""When a case has been measured enough. Pure: it looks at times and variances of rounds only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from freepath.measure.stats import relative_half_width

PILOT_ROUNDS = 5
"""Rounds after which the number that the wanted error needs is fixed: stopping as soon as an
estimate looks precise would favour lucky ones."""
PATIENCE = 20.0
"""Of a case whose prediction is to be confirmed."""


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
    patience: float = 1.0
    """So many times at_most_s a case may take until its error is as wanted."""

    def confirming(self, error: float) -> Rule:
        """What a prediction needs that is to be held to a measurement: its error must be known."""
        return replace(self, error=min(self.error, error), patience=PATIENCE)


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
        over = spent_s >= self.rule.at_most_s
        if self._error_is_known(variances):
            if relative_half_width(times) <= self.rule.time_noise:
                return "precise"
            return "budget" if over else ""
        return "budget" if spent_s >= self.rule.at_most_s * self.rule.patience else ""

    def _error_is_known(self, variances: Sequence[float]) -> bool:
        """Whether the rounds that were planned are over, and, with patience, were enough.

        Rare high scores may have kept out of the pilot's. While they do not, twice as many rounds
        are made before it is asked again, so that luck has few chances; a case that goes on for its
        times alone is asked in each, which can only make it go on for longer.
        """
        wanted = self._rounds_for_error
        if wanted is None or len(variances) < wanted:
            return False
        if self.rule.patience > 1 and self._planned(variances) > len(variances):
            self._rounds_for_error = 2 * len(variances)
            return False
        return True

    def _planned(self, variances: Sequence[float]) -> int:
        """How many rounds the wanted interval of the RMSE takes, from the spread of the pilot's."""
        # The RMSE is the root of the variance: half its relative error.
        half_width = relative_half_width(variances) / 2
        if not math.isfinite(half_width):
            return len(variances)
        return math.ceil(len(variances) * (half_width / self.rule.error) ** 2)
