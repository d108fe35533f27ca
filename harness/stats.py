"""The statistics of rounds: merging moments, intervals, and what a row of the report derives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats as distributions

CONFIDENCE = 0.95
_Z = float(distributions.norm.ppf(0.5 + CONFIDENCE / 2))


@dataclass(frozen=True)
class Moments:
    """Count, mean and sum of squared deviations of the scores of each ray; float64 arrays (rays,)."""

    count: int
    mean: np.ndarray
    m2: np.ndarray

    def merged(self, other: Moments) -> Moments:
        """Both together (Chan, Golub, LeVeque 1983, eq. 2.1)."""
        count = self.count + other.count
        difference = other.mean - self.mean
        mean = self.mean + difference * (other.count / count)
        m2 = self.m2 + other.m2 + difference**2 * (self.count * other.count / count)
        return Moments(count, mean, m2)

    @property
    def variance(self) -> np.ndarray:
        """Unbiased variance of one sample, per ray; needs two samples."""
        return self.m2 / (self.count - 1)


def merge_blocks(mean: np.ndarray, m2: np.ndarray, samples: int) -> Moments:
    """Merge blocks of equally many samples; mean and m2 have the shape (blocks, rays)."""
    mean, m2 = mean.astype(np.float64), m2.astype(np.float64)
    merged = mean.mean(0)
    within = m2.sum(0)
    between = samples * ((mean - merged) ** 2).sum(0)
    return Moments(samples * len(mean), merged, within + between)


def relative_half_width(values: list[float]) -> float:
    """Half the 95 % interval of the mean of independent values, relative to it; inf below two."""
    if len(values) < 2:
        return math.inf
    mean = float(np.mean(values))
    spread = float(np.std(values, ddof=1))
    if spread == 0:
        return 0.0
    quantile = float(distributions.t.ppf(0.5 + CONFIDENCE / 2, len(values) - 1))
    return quantile * spread / math.sqrt(len(values)) / abs(mean) if mean else math.inf


@dataclass(frozen=True)
class Accuracy:
    """How an estimate stands to its reference. All are of one sample per ray, averaged over rays."""

    estimate: float
    reference: float
    bias: float
    bias_stderr: float
    z_score: float | None
    """None where the estimator has no variance, so that no standard error is there to divide by."""
    bias_rms: float
    variance: float

    @property
    def rmse(self) -> float:
        """Root mean square error of one sample."""
        return math.sqrt(self.variance + self.bias_rms**2)

    def time_to(self, relative_error: float, time_per_sample: float) -> float:
        """Device seconds a ray until the relative RMSE falls below an error; inf if it never does.

        Solves RMSE(t)^2 = bias^2 + variance * time_per_sample / t; one sample is the least.
        """
        room = (relative_error * self.reference) ** 2 - self.bias_rms**2
        if room <= 0:
            return math.inf
        return time_per_sample * max(1.0, self.variance / room)


def accuracy(moments: Moments, reference: np.ndarray) -> Accuracy:
    """Compare the merged moments of all rounds with the float64 reference of each ray."""
    rays = len(moments.mean)
    error_of_mean = moments.variance / moments.count
    deviation = moments.mean - reference
    bias = float(deviation.mean())
    stderr = math.sqrt(float(error_of_mean.sum())) / rays
    return Accuracy(
        estimate=float(moments.mean.mean()),
        reference=float(reference.mean()),
        bias=bias,
        bias_stderr=stderr,
        z_score=bias / stderr if stderr > 0 else None,
        bias_rms=_significant_bias(deviation, error_of_mean),
        variance=float(moments.variance.mean()),
    )


def _significant_bias(deviation: np.ndarray, error_of_mean: np.ndarray) -> float:
    """Root mean square over rays of the bias, its noise taken out; 0 where noise explains it.

    E[deviation^2] = bias^2 + error_of_mean. Of an unbiased estimator the difference has a standard
    deviation of at least sqrt(2 sum error^2) / rays: what is below four of them counts as none.
    """
    excess = float((deviation**2 - error_of_mean).mean())
    noise = math.sqrt(2 * float((error_of_mean**2).sum())) / len(deviation)
    return math.sqrt(excess) if excess > 4 * noise else 0.0
