"""The statistics of rounds: merging moments, intervals, and what a row of the report derives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from freepath.measure.ladder import Ladder

CONFIDENCE = 0.95
SIGNIFICANT = 4.0
"""Standard deviations beyond which the biases of single rays are more than the noise in them."""
SIX = 6.0
"""Standard errors beyond which what claims to be unbiased is not: by chance 2 in 1e9."""
CARRIERS = 60.0
"""Units, of which fewer say nothing of the noise of a variance: docs/estimators.md."""
RARE = 20.0
"""Events of which none is seen when so many are expected: exp(-20) = 2e-9, about as rare as SIX."""


@dataclass(frozen=True)
class Moments:
    """Count, mean and sum of squared deviations of the scores of each ray, float64.

    Of the shape (rays,), or (rays, channels) where there are several. Those of a path are
    correlated; `joint_m2` (rays,) is the sum of squared deviations of the mean over channels.
    """

    count: int
    mean: np.ndarray
    m2: np.ndarray
    joint_m2: np.ndarray | None = None

    @property
    def flat(self) -> Moments:
        """Without the axis of channels, of one."""
        return Moments(self.count, self.mean[:, 0], self.m2[:, 0])

    @property
    def of_channels(self) -> Moments:
        """Of channels, from those of channels and of the mean over them, which comes last."""
        return Moments(self.count, self.mean[:, :-1], self.m2[:, :-1], self.m2[:, -1])

    @property
    def joint_variance(self) -> np.ndarray:
        """Unbiased variance of the mean over channels of one sample, per ray (rays,)."""
        joint = self.m2 if self.joint_m2 is None else self.joint_m2
        return joint / (self.count - 1)

    def merged(self, other: Moments) -> Moments:
        """Both together (Chan, Golub, LeVeque 1983, eq. 2.1)."""
        count = self.count + other.count
        difference = other.mean - self.mean
        mean = self.mean + difference * (other.count / count)
        share = self.count * other.count / count
        m2 = self.m2 + other.m2 + difference**2 * share
        if self.joint_m2 is None:
            return Moments(count, mean, m2)
        joint = self.joint_m2 + other.joint_m2 + difference.mean(axis=1) ** 2 * share
        return Moments(count, mean, m2, joint)

    @property
    def variance(self) -> np.ndarray:
        """Unbiased variance of one sample, shaped as the mean; needs a count of two."""
        return self.m2 / (self.count - 1)


def merge_blocks(mean: np.ndarray, m2: np.ndarray, samples: int) -> Moments:
    """Merge blocks of equally many samples; mean and m2 have the shape (blocks, rays, ...)."""
    mean, m2 = mean.astype(np.float64), m2.astype(np.float64)
    # from the first block on, or rounding would give blocks that are all alike a variance
    merged = mean[0] + (mean - mean[0]).mean(0)
    between = samples * ((mean - merged) ** 2).sum(0)
    return Moments(samples * len(mean), merged, m2.sum(0) + between)


def squares_of(mean: np.ndarray, m2: np.ndarray, samples: int) -> np.ndarray:
    """Sums of squared deviations from the mean of the ray, (blocks, rays), over channels.

    Of blocks of equally many samples; mean and m2 have the shape (blocks, rays, channels).
    """
    mean, m2 = mean.astype(np.float64), m2.astype(np.float64)
    return (m2 + samples * (mean - mean.mean(0)) ** 2).sum(-1)


def relative_half_width(values: Sequence[float]) -> float:
    """Half the 95 % interval of the mean of independent values, relative to it; inf below two.

    Student's t; 0 where all values are the same.
    """
    if len(values) < 2:
        return math.inf
    mean, spread = float(np.mean(values)), float(np.std(values, ddof=1))
    if min(values) == max(values):
        return 0.0
    quantile = float(special.stdtrit(len(values) - 1, 0.5 + CONFIDENCE / 2))
    return quantile * spread / math.sqrt(len(values)) / abs(mean) if mean else math.inf


class Tail:
    """How many parts of a measurement its knowledge of the variance rests on.

    A unit of samples of a ray gives the sum of squared deviations of its scores. How far these sums
    spread tells how well the variance is known, unless that spread is itself the work of a few
    units with rare high scores: then it tells what these did, and nothing of those yet rarer. D
    being the squared deviation of a sum from the mean of its ray, (sum of D)^2 / (sum of D^2) units
    carry the spread: a third of them for normal sums. Where the fourth moment of scores is infinite
    the largest D is a share of all that does not fall with their number (Embrechts, Klueppelberg,
    Mikosch 1997, 6.2.6), and so the spread stays with a few.
    """

    def __init__(self) -> None:
        self._start: np.ndarray | None = None
        self._sums: np.ndarray | None = None
        self._count = 0

    def add(self, squares: np.ndarray) -> None:
        """Add units of equally many samples, (units, rays): their sums of squared deviations."""
        if self._start is None:
            self._start, self._sums = squares.mean(0), np.zeros((4, squares.shape[1]))
        from_start = squares - self._start
        self._sums += [(from_start**power).sum(0) for power in (1, 2, 3, 4)]
        self._count += len(squares)

    @property
    def units(self) -> float:
        """So many units carry the spread of the variance; inf where there is none."""
        if self._sums is None:
            return math.inf
        first, second, third, fourth = self._sums / self._count
        spread = second - first**2
        square = fourth - 4.0 * first * third + 6.0 * first**2 * second - 3.0 * first**4
        if not square.sum() > 0:
            return math.inf
        return float(self._count * np.maximum(spread, 0.0).sum() ** 2 / square.sum())

    @property
    def told(self) -> bool:
        """Whether the spread over rounds says how well the variance is known."""
        return self.units >= CARRIERS


@dataclass(frozen=True)
class Accuracy:
    """How an estimate stands to its reference; of one sample a ray, averaged over rays."""

    estimate: float
    reference: float | None
    """None where the exact value is not known; then so is the bias."""
    bias: float | None
    bias_stderr: float
    bias_rms: float | None
    variance: float
    samples: int
    """Of all rays together."""

    @property
    def z_score(self) -> float | None:
        """The bias in standard errors; None where it is unknown or nothing varies."""
        known = self.bias is not None and self.bias_stderr > 0
        return self.bias / self.bias_stderr if known else None

    @property
    def rmse(self) -> float:
        """Root mean square error of one sample."""
        return math.sqrt(self.variance + (self.bias_rms or 0.0) ** 2)

    @property
    def unseen(self) -> bool:
        """Whether all scores were 0 and should not be on average: their variance is unknown."""
        return self.estimate == 0 == self.variance and self.reference != 0

    def contradicted(self, largest: float, rounding: float) -> bool:
        """Whether scores of at most `largest` cannot have the reference as their expectation.

        They must be off by more than SIX standard errors and the arithmetic's relative rounding.
        Where high scores are rare (a transmittance of 1e-20), scores and their variance may be 0
        for a million samples, which says nothing: what is missing must then amount to RARE scores.
        """
        if self.bias is None:
            return False
        off = abs(self.bias) - rounding * abs(self.reference)
        if self.variance == 0 and self.estimate != 0:
            return off > 0
        explained = abs(self.bias) * self.samples < RARE * largest
        return not explained and off > SIX * self.bias_stderr

    def time_to(self, relative_error: float, time_per_sample: float) -> float | None:
        """Device seconds a ray until the relative RMSE falls to an error; inf if it never does.

        None where the variance is unknown. Where the reference is, the error is that of the
        estimate, taken to be unbiased.
        """
        if self.unseen:
            return None
        scale = self.estimate if self.reference is None else self.reference
        ladder = Ladder(self.bias_rms or 0.0, self.variance, time_per_sample)
        return ladder.time_to(relative_error * scale)


def accuracy(moments: Moments, reference: np.ndarray | None) -> Accuracy:
    """Compare the merged moments of all rounds with the float64 reference, if there is one.

    It is shaped as the mean, or (rays,) for channels that are all alike.

    Of several channels all is averaged over them too; that they are correlated is in `bias_stderr`.
    """
    rays = len(moments.mean)
    error_of_mean = moments.variance / moments.count
    deviation = None
    if reference is not None:
        if reference.ndim < moments.mean.ndim:
            reference = reference[:, None]
        deviation = moments.mean - reference
    return Accuracy(
        estimate=float(moments.mean.mean()),
        reference=None if deviation is None else float(reference.mean()),
        bias=None if deviation is None else float(deviation.mean()),
        bias_stderr=math.sqrt(float((moments.joint_variance / moments.count).sum())) / rays,
        bias_rms=None if deviation is None else _significant_bias(deviation, error_of_mean),
        variance=float(moments.variance.mean()),
        samples=rays * moments.count,
    )


def _significant_bias(deviation: np.ndarray, error_of_mean: np.ndarray) -> float:
    """Root mean square over rays of the bias, its noise taken out; 0 where noise explains it.

    E[deviation^2] = bias^2 + error_of_mean. Of an unbiased estimator the difference has a standard
    deviation of about sqrt(2 sum error_of_mean^2) / rays; of several channels it is at most that
    of channels that are all the same.
    """
    excess = float((deviation**2 - error_of_mean).mean())
    alike = deviation.size / len(deviation)
    noise = math.sqrt(2 * alike * float((error_of_mean**2).sum())) / deviation.size
    return math.sqrt(excess) if excess > SIGNIFICANT * noise else 0.0
