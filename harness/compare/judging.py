"""Verdicts on the cases of two results: times, noise, estimates and lookups, each by its rule."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from freepath.compare.pairing import Key, Side
from freepath.compare.timing import Change, changes
from freepath.table import FAILED, Row, number
from scipy import stats

VERDICTS = (
    "SAME", "FASTER", "SLOWER", "MORE_NOISE", "LESS_NOISE", "DIFFERENT", "MISSING", "NEW",
)  # fmt: skip
REGRESSIONS = ("SLOWER", "MORE_NOISE", "DIFFERENT", "MISSING")
SMALLEST = np.finfo(float).tiny
SAMPLE = ("seed", "rays", "driver_version", "lanes", "arithmetic", "storage")
"""Where these are equal, both took the same samples: nothing is left to chance."""
ROUNDING = 1e-6
"""Relative difference of estimates without variance that different compilers may cause."""


@dataclass(frozen=True)
class Settings:
    """What a comparison is by."""

    alpha: float = 0.05
    """Expected share of false findings among all findings; where nothing changed, their chance."""
    factor: float = 1.01
    """Ratio of times, and of variances, that is too small to matter."""
    drift: float | None = None
    """Ratio by which all times of a machine may differ between two runs without a reason; None to
    judge that by the runs, where there are several, and else to take all of it for drift."""
    times: bool = True
    """Whether times are compared."""


@dataclass(frozen=True)
class Judged:
    """A case on both sides. Ratios are contender / reference."""

    key: Key
    row: Row
    verdict: str
    time_ratio: float | None = None
    time_low: float | None = None
    time_high: float | None = None
    variance_ratio: float | None = None
    difference: float | None = None
    """Of the estimates, relative to the reference value."""
    z_score: float | None = None
    lookups_ratio: float | None = None
    p_value: float | None = None
    why: str = ""

    @property
    def regressed(self) -> bool:
        """Whether it is a reason to object."""
        return self.verdict in REGRESSIONS


@dataclass
class _Test:
    """One null hypothesis: its p-value, and what its rejection means."""

    key: Key
    verdict: str
    p_value: float
    why: str


def compare(reference: Side, contender: Side, settings: Settings) -> tuple[list[Judged], dict]:
    """Judge every case of either side; also returns the shift of each scene.

    The tests of all rows are corrected together by Benjamini and Hochberg (1995).
    """
    before, after = reference.rows, contender.rows
    timed, shifts = {}, {}
    if settings.times:
        timed, shifts = changes(reference, contender, settings.drift, settings.alpha)
    judged: dict[Key, Judged] = {}
    tests: list[_Test] = []
    for key in dict.fromkeys([*before, *after]):
        one = _unpaired(key, before.get(key), after.get(key))
        if one is None:
            one = _measured(key, before[key], after[key], timed.get(key))
            tests += _tests(key, before[key], after[key], timed.get(key), settings)
            noise = _noise(key, reference, contender, settings.factor)
            if noise:
                one = replace(one, variance_ratio=noise[0])
                tests += noise[1]
        judged[key] = one
    _decide(judged, tests, settings.alpha)
    return list(judged.values()), shifts


def _unpaired(key: Key, before: Row | None, after: Row | None) -> Judged | None:
    """The verdict on a case that one side lacks, or where it failed; None for all others."""
    if before is None:
        return Judged(key, after, "NEW")
    if after is None:
        return Judged(key, before, "MISSING", why="the contender has no such case")
    if after["status"] in FAILED and before["status"] == "ok":
        return Judged(key, after, "DIFFERENT", why=f"{after['status']}: {after['reason']}")
    if "ok" not in (before["status"], after["status"]):
        return Judged(key, after, "SAME", why=f"{after['status']} in both")
    if before["status"] != "ok":
        return Judged(key, after, "NEW", why=f"was {before['status']}")
    return None


def _measured(key: Key, before: Row, after: Row, change: Change | None) -> Judged:
    """The numbers of a pair, not judged yet."""
    pair = [number(row, "lookups_per_sample") for row in (before, after)]
    difference, z = _difference(before, after)
    one = Judged(
        key,
        after,
        "SAME",
        difference=difference,
        z_score=z,
        lookups_ratio=pair[1] / pair[0] if pair[0] and pair[1] is not None else None,
    )
    if change is None:
        return one
    width = float(stats.t.ppf(0.975, change.freedom)) * change.stderr
    low, middle, high = (
        math.exp(min(700.0, change.log_ratio + side * width)) for side in (-1, 0, 1)
    )
    return replace(one, time_ratio=middle, time_low=low, time_high=high)


def _difference(before: Row, after: Row) -> tuple[float, float | None]:
    """Contender's estimate less the reference's: relative to the exact value, in standard errors.

    Where the exact value is unknown, as of most radiance, relative to the reference's estimate.
    """
    first, second = number(before, "estimate"), number(after, "estimate")
    known = number(before, "reference")
    scale = abs(first if known is None else known) or 1.0
    stderr = math.hypot(number(before, "bias_stderr"), number(after, "bias_stderr"))
    difference = second - first
    return difference / scale, difference / stderr if stderr > 0 else None


def _tests(
    key: Key, before: Row, after: Row, change: Change | None, settings: Settings
) -> list[_Test]:
    found = []
    if change is not None:
        slower, faster = change.p_beyond(math.log(settings.factor))
        found.append(_Test(key, "SLOWER", slower, "time"))
        found.append(_Test(key, "FASTER", faster, "time"))
    difference, z = _difference(before, after)
    if _equal(before, after, *SAMPLE, "counted_samples"):
        same = before["lookups_per_sample"] == after["lookups_per_sample"]
        found.append(_Test(key, "DIFFERENT", float(same), "lookups of the same samples"))
    if _equal(before, after, *SAMPLE, "samples_per_ray"):
        same = abs(difference) <= ROUNDING
        found.append(_Test(key, "DIFFERENT", float(same), "estimate of the same samples"))
    elif z is None:
        found.append(_Test(key, "DIFFERENT", float(abs(difference) <= ROUNDING), "estimate"))
    else:
        found.append(_Test(key, "DIFFERENT", float(2 * stats.norm.sf(abs(z))), "estimate"))
    return found


def _equal(before: Row, after: Row, *columns: str) -> bool:
    return all(before[name] == after[name] for name in columns)


def _noise(
    key: Key, reference: Side, contender: Side, factor: float
) -> tuple[float, list[_Test]] | None:
    """Ratio of the variances of one sample, and the tests of it, by Welch on rounds' variances."""
    pair = []
    for side in (reference, contender):
        values = [v for run in side.runs for v in run.variances.get(key, ())]
        if len(values) < 2 or not np.mean(values) > 0:
            return None
        mean = float(np.mean(values))
        pair.append((mean, float(np.var(values, ddof=1)) / len(values) / mean**2, len(values) - 1))
    (first, error, freedom), (second, other, other_freedom) = pair
    ratio, variance = second / first, error + other
    spread = error**2 / freedom + other**2 / other_freedom
    change = Change(
        math.log(ratio), math.sqrt(variance), variance**2 / spread if spread > 0 else 1.0
    )
    more, less = change.p_beyond(math.log(factor))
    noisier = _Test(key, "MORE_NOISE", more, "variance")
    return ratio, [noisier, _Test(key, "LESS_NOISE", less, "variance")]


def _decide(judged: dict[Key, Judged], tests: list[_Test], alpha: float) -> None:
    """Give each case the worst verdict that its corrected tests support."""
    if not tests:
        return
    p_values = [max(test.p_value, SMALLEST) for test in tests]
    corrected = stats.false_discovery_control(p_values)
    worst = ("DIFFERENT", "SLOWER", "MORE_NOISE", "FASTER", "LESS_NOISE")
    for test, p_value in sorted(
        zip(tests, corrected, strict=True), key=lambda pair: -worst.index(pair[0].verdict)
    ):
        if p_value <= alpha:
            old = judged[test.key]
            judged[test.key] = replace(
                old, verdict=test.verdict, p_value=float(p_value), why=test.why
            )
