"""The accuracy ladder: RMSE(t)^2 = bias^2 + variance x time_per_sample / t, solved here alone."""

from __future__ import annotations

import math
from typing import NamedTuple


class Ladder(NamedTuple):
    """What the error of a case falls to in time; t is device seconds on a ray."""

    bias: float
    """Root mean square over rays."""
    variance: float
    """Of one sample."""
    time_per_sample_s: float

    def rmse_after(self, time_s: float) -> float:
        """The RMSE after so long."""
        return math.sqrt(self.bias**2 + self.variance * self.time_per_sample_s / time_s)

    def time_to(self, rmse: float) -> float:
        """Device seconds until it falls to an RMSE, one sample at least; inf if it never does."""
        room = rmse**2 - self.bias**2
        if self.variance == 0:
            return self.time_per_sample_s if room >= 0 else math.inf
        return self.time_per_sample_s * max(1.0, self.variance / room) if room > 0 else math.inf
