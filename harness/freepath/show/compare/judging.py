"""Verdicts on the cases of two results: times, noise, estimates and lookups, each by its rule."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from freepath.errors import expect
from freepath.show.compare.pairing import Key, Side
from freepath.show.compare.timing import Change, changes
from freepath.show.table import FAILED, Row, number

VERDICTS = (
    "SAME", "UNDECIDED", "FASTER", "SLOWER", "MORE_NOISE", "LESS_NOISE", "DIFFERENT", "MISSING",
    "NEW",
)  # fmt: skip
REGRESSIONS = ("SLOWER", "MORE_NOISE", "DIFFERENT", "MISSING")
SMALLEST = np.finfo(float).tiny
SAMPLE = ("seed", "rays", "driver_version", "lanes", "arithmetic", "storage")
"""Where these are equal, both took the same samples: nothing is left to chance."""
TO_SHOW = 1.05
"""The least ratio of times of which it is said how many runs would show it."""
ROUNDING = 1e-6
"""Relative difference of estimates without variance that different compilers may cause."""


@dataclass(frozen=True)
class Settings:
    """What a comparison is by."""

    alpha: float = 0.05
    """Expected share of false findings among all findings; where nothing changed, their chance."""
    factor: float = 1.01
    """Ratio of times, of variances and of estimates that is too small to matter."""
    drift: float | None = None
    """Ratio by which all times of a machine may differ between two runs without a reason; None to
    judge that by the runs, where there are several, and else to take all of it for drift."""
    times: bool = True
    """Whether times are compared."""
    same_samples: bool = True
    """Whether the same seed on both sides means the same samples; not of code that draws others."""

    def __post_init__(self) -> None:
        """Raise UsageError for what is none of these."""
        for name, least, most, what in (
            ("alpha", SMALLEST, 1 - 1e-9, "a share between 0 and 1"),
            ("factor", 1, 1e6, "a ratio of 1 or more"),
            ("drift", 1, 1e6, "a ratio of 1 or more, or None"),
        ):
            value = getattr(self, name)
            given = 1 if name == "drift" and value is None else value
            fits = isinstance(given, (int, float)) and least <= given <= most
            expect(name, fits, what, value)

    @property
    def to_show(self) -> float:
        """The ratio of times of which an undecided case says how many runs would show it."""
        return max(TO_SHOW, self.factor**2)


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
    seen_from: float | None = None
    """Where times are undecided: the least ratio of them that would have been seen (95 %)."""
    runs: int | None = None
    """And how many runs per side would show `Settings.to_show`; None where no number would."""
    why: str = ""

    @property
    def regressed(self) -> bool:
        """Whether it is a reason to object."""
        return self.verdict in REGRESSIONS


@dataclass
class _Pair:
    """What is known of a case that both sides measured."""

    before: Row
    after: Row
    time: Change | None
    noise: Change | None


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
    pairs: dict[Key, _Pair] = {}
    for key in dict.fromkeys([*before, *after]):
        one = _unpaired(key, before.get(key), after.get(key))
        if one is None:
            pair = _Pair(before[key], after[key], timed.get(key), _noise(key, reference, contender))
            pairs[key] = pair
            one = _measured(key, pair)
            tests += _tests(key, pair, settings)
        judged[key] = one
    _decide(judged, tests, settings.alpha)
    runs = min(len(reference.runs), len(contender.runs))
    level = settings.alpha / max(1, len(tests))
    for key, pair in pairs.items():
        if judged[key].verdict == "SAME":
            judged[key] = _shown(judged[key], pair, settings, level, runs)
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
        return Judged(key, after, "UNDECIDED", why=f"{after['status']} in both")
    if before["status"] != "ok":
        return Judged(key, after, "NEW", why=f"was {before['status']}")
    return None


def _measured(key: Key, pair: _Pair) -> Judged:
    """The numbers of a pair, not judged yet."""
    lookups = [number(row, "lookups_per_sample") for row in (pair.before, pair.after)]
    difference, _, z = _difference(pair.before, pair.after)
    one = Judged(
        key,
        pair.after,
        "SAME",
        difference=difference,
        z_score=z,
        lookups_ratio=lookups[1] / lookups[0] if lookups[0] and lookups[1] is not None else None,
    )
    if pair.noise:
        one = replace(one, variance_ratio=math.exp(pair.noise.log_ratio))
    if pair.time is None:
        return one
    low, middle, high = (
        _ratio(pair.time.log_ratio + side * pair.time.width) for side in (-1, 0, 1)
    )
    return replace(one, time_ratio=middle, time_low=low, time_high=high)


def _ratio(log: float) -> float:
    return math.exp(min(700.0, log))


def _shown(one: Judged, pair: _Pair, settings: Settings, level: float, runs: int) -> Judged:
    """SAME, where all that is compared is shown to be within the factor; else UNDECIDED, and why.

    Times of single runs are compared beside those of the other cases: that all of them became
    slower together they cannot show, nor that none did, unless `drift` says what to think of it.
    """
    limit, why = math.log(settings.factor), []
    if settings.times and pair.time is None:
        why.append("no rounds to compare times by")
    elif settings.times and not pair.time.within(limit):
        seen = _ratio(pair.time.seen_from(limit, level))
        needed = pair.time.runs_to_show(math.log(settings.to_show) - limit, level, runs)
        one = replace(one, seen_from=seen, runs=needed)
        beside = ", beside the other cases" if pair.time.shared else ""
        why.append(f"time: no change below x{seen:.3g} would have been seen{beside}")
    if not _same(pair, settings, "samples_per_ray"):
        if pair.noise and not pair.noise.within(limit):
            seen = _ratio(pair.noise.seen_from(limit, level))
            why.append(f"variance: no change below x{seen:.3g} would have been seen")
        elif not pair.noise and any(number(row, "variance") for row in (pair.before, pair.after)):
            why.append("too few rounds to compare variances by")
        difference, width, _ = _difference(pair.before, pair.after)
        if abs(difference) + width > settings.factor - 1:
            why.append(f"estimate: may differ by {100 * (abs(difference) + width):.2g} %")
    return replace(one, verdict="UNDECIDED", why="; ".join(why)) if why else one


def _difference(before: Row, after: Row) -> tuple[float, float, float | None]:
    """Contender's estimate less the reference's: relative to the exact value, with half its 95 %
    interval; and in standard errors.

    Where the exact value is unknown, as of most radiance, relative to the reference's estimate.
    """
    first, second = number(before, "estimate"), number(after, "estimate")
    known = number(before, "reference")
    scale = abs(first if known is None else known) or 1.0
    stderr = math.hypot(number(before, "bias_stderr"), number(after, "bias_stderr"))
    difference = second - first
    z = difference / stderr if stderr > 0 else None
    return difference / scale, 1.96 * stderr / scale, z


def _tests(key: Key, pair: _Pair, settings: Settings) -> list[_Test]:
    found, limit = [], math.log(settings.factor)
    for change, more, less, what in (
        (pair.time, "SLOWER", "FASTER", "time"),
        (pair.noise, "MORE_NOISE", "LESS_NOISE", "variance"),
    ):
        if change is not None:
            above, below = change.p_beyond(limit)
            found += [_Test(key, more, above, what), _Test(key, less, below, what)]
    before, after = pair.before, pair.after
    difference, _, z = _difference(before, after)
    if _same(pair, settings, "counted_samples"):
        same = before["lookups_per_sample"] == after["lookups_per_sample"]
        found.append(_Test(key, "DIFFERENT", float(same), "lookups of the same samples"))
    if _same(pair, settings, "samples_per_ray"):
        same = abs(difference) <= ROUNDING
        found.append(_Test(key, "DIFFERENT", float(same), "estimate of the same samples"))
    elif z is None:
        found.append(_Test(key, "DIFFERENT", float(abs(difference) <= ROUNDING), "estimate"))
    else:
        found.append(_Test(key, "DIFFERENT", float(2 * stats.norm.sf(abs(z))), "estimate"))
    return found


def _same(pair: _Pair, settings: Settings, count: str) -> bool:
    """Whether both took the same samples, and as many."""
    equal = all(pair.before[name] == pair.after[name] for name in (*SAMPLE, count))
    return settings.same_samples and equal


def _noise(key: Key, reference: Side, contender: Side) -> Change | None:
    """The change of the variance of one sample, by Welch on rounds' variances."""
    sides = []
    for side in (reference, contender):
        values = [v for run in side.runs for v in run.variances.get(key, ())]
        if len(values) < 2 or not np.mean(values) > 0:
            return None
        mean = float(np.mean(values))
        sides.append((mean, float(np.var(values, ddof=1)) / len(values) / mean**2, len(values) - 1))
    (first, error, freedom), (second, other, other_freedom) = sides
    variance = error + other
    spread = error**2 / freedom + other**2 / other_freedom
    return Change(
        math.log(second / first), math.sqrt(variance), variance**2 / spread if spread > 0 else 1.0
    )


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
