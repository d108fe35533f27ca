"""The rule for times: effects of cases with the machine's drift taken out, and how sure they are.

Rounds of a scene's cases take turns, a round of each in a pass, so a drift of the machine hits all
cases of a pass alike. log(time) = case + pass + noise is fitted robustly, as Tukey's median polish
does but by lower quartiles: what disturbs a round makes it longer, often twice as long, and never
shorter. What is compared between two runs is the case's part. How far the level of all cases has
moved together is separated: within what a machine may drift it is no case's fault.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.special import stdtr, stdtrit

from freepath.show.compare.moderation import moderated
from freepath.show.compare.pairing import Key, Run, Side, scenes, table_of

SWEEPS = 6
"""Of the polish; it settles within a few."""
QUIET = 0.25
"""The quantile of times that stands for those of an undisturbed machine."""
BATCHES = 10
"""Neighbouring passes are put together into so many batches, as what disturbs one lasts."""
ALONE = 0.3
"""Standard deviation of a change, in logs, where no other cases of the scene tell it."""
SURE = 0.95
"""The power that "would have been seen" means."""
MOST_RUNS = 1000
LEAST_RUNS = 3
"""With so many runs on either side, runs are what is compared: they differ by more than rounds."""


@dataclass(frozen=True)
class Effect:
    """The level of a case's log time, its variance and degrees of freedom."""

    level: float
    variance: float
    freedom: float


@dataclass(frozen=True)
class Change:
    """log(contender / reference) of a case, its standard error and degrees of freedom."""

    log_ratio: float
    stderr: float
    freedom: float
    shared: float = 0.0
    """How far, in logs, all cases of the scene may have changed alike (95 %) and it was taken for a
    drift of the machine; infinite where nothing tells how far."""

    @property
    def width(self) -> float:
        """Half the 95 % interval."""
        return float(stdtrit(self.freedom, 0.975)) * self.stderr

    def within(self, limit: float) -> bool:
        """Whether the interval, and what all cases share, is no further from 0 than a limit."""
        return abs(self.log_ratio) + self.width + self.shared <= limit

    def seen_from(self, limit: float, level: float) -> float:
        """The least change beyond a limit that is found in 95 % of comparisons (logs).

        By tests at that level; no less than what this interval holds, as a change is known to be
        no larger only by that.
        """
        quantiles = float(stdtrit(self.freedom, 1.0 - level) + stdtrit(self.freedom, SURE))
        power = limit + quantiles * self.stderr
        return max(power, abs(self.log_ratio) + self.width)

    def runs_to_show(self, change: float, level: float, runs: int) -> int | None:
        """How many runs per side find a change (beyond a limit, logs) in 95 % of comparisons.

        From the error that so many `runs` have; None where MOST_RUNS would not do.
        """
        counts, needed = _needed(level)
        enough = needed * self.stderr * math.sqrt(runs) <= change
        return int(counts[enough.argmax()]) if enough.any() else None

    def p_beyond(self, limit: float) -> tuple[float, float]:
        """One-sided p-values that the ratio is no more than +limit, no less than -limit (logs)."""
        if not self.stderr > 0:
            return float(self.log_ratio <= limit), float(self.log_ratio >= -limit)
        slower = stdtr(self.freedom, (limit - self.log_ratio) / self.stderr)
        faster = stdtr(self.freedom, (limit + self.log_ratio) / self.stderr)
        return float(slower), float(faster)


@functools.lru_cache
def _needed(level: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of runs per side, and the standard errors of one run that they can tell apart."""
    counts = np.arange(LEAST_RUNS, MOST_RUNS + 1)
    freedom = 2.0 * counts - 2.0
    return counts, (stdtrit(freedom, 1.0 - level) + stdtrit(freedom, SURE)) / np.sqrt(counts)


def _quiet(table: np.ndarray) -> np.ndarray:
    """QUIET quantiles of rows without NaN; numpy's own take a loop over rows for that."""
    ordered, places = np.sort(table, axis=-1), QUIET * (np.isfinite(table).sum(-1) - 1)
    rows, below = np.arange(len(table)), np.floor(places).astype(int)
    low, high = ordered[rows, below], ordered[rows, np.ceil(places).astype(int)]
    return low + (places - below) * (high - low)


def polished(table: np.ndarray) -> np.ndarray:
    """A table (cases, passes), with NaN in it, less what passes have in common (passes)."""
    columns = np.zeros(table.shape[1])
    for _ in range(SWEEPS):
        rows = _quiet(table - columns)
        columns = _quiet((table - rows[:, None]).T)
        columns -= np.median(columns)
    return table - columns


def effects(run: Run) -> dict[Key, tuple[Effect, Key]]:
    """The effect of each case of a run, and the scene that it is of."""
    if run.effects is None:
        run.effects = _effects(run)
    return run.effects


def _effects(run: Run) -> dict[Key, tuple[Effect, Key]]:
    found = {}
    for scene, keys in scenes(run).items():
        table = table_of([run.times[key] for key in keys])
        adjusted = polished(table) if len(keys) > 2 else table
        for key, row in zip(keys, adjusted, strict=True):
            found[key] = _effect(row[np.isfinite(row)]), scene
    return found


def _effect(values: np.ndarray) -> Effect:
    """The QUIET quantile, and its variance by leaving out one batch of neighbours after another."""
    count = min(BATCHES, len(values))
    levels = _quiet(np.where(_left_out(len(values), count), np.nan, values))
    variance = (count - 1.0) ** 2 / count * float(levels[:-1].var(ddof=1))
    return Effect(float(levels[-1]), variance, count - 1.0)


@functools.lru_cache
def _left_out(length: int, count: int) -> np.ndarray:
    """Which of so many values are in each of `count` batches; in the last row none."""
    places = np.array_split(np.arange(length), count)
    return np.array([np.isin(np.arange(length), batch) for batch in [*places, []]])


def pooled(side: Side) -> dict[Key, Effect]:
    """The effect of each case of a side.

    Of several runs its variance is that between them, less what all cases of a scene share.
    """
    runs = [effects(run) for run in side.runs]
    commons = [_commons(run) for run in runs]
    found = {}
    for key in {key for run in runs for key in run}:
        given = [
            (run[key][0], common[run[key][1]])
            for run, common in zip(runs, commons, strict=True)
            if key in run
        ]
        level = float(np.mean([effect.level for effect, _ in given]))
        if len(given) >= LEAST_RUNS:
            alone = np.array([effect.level - common for effect, common in given])
            found[key] = Effect(level, float(alone.var(ddof=1)) / len(given), len(given) - 1.0)
        else:
            variance = sum(effect.variance for effect, _ in given) / len(given) ** 2
            found[key] = Effect(level, variance, sum(effect.freedom for effect, _ in given))
    return found


def _commons(run: dict[Key, tuple[Effect, Key]]) -> dict[Key, float]:
    """The median level of each scene's cases; 0 where they are too few to have one in common."""
    levels: dict[Key, list[float]] = {}
    for effect, scene in run.values():
        levels.setdefault(scene, []).append(effect.level)
    return {scene: float(np.median(x)) if len(x) > 2 else 0.0 for scene, x in levels.items()}


def changes(
    reference: Side, contender: Side, drift: float | None, alpha: float
) -> tuple[dict[Key, Change], dict[Key, tuple[float, float]]]:
    """The change of each case that both sides measured; and of each scene its shift, in logs.

    A shift is what all cases of a scene change by together (a median), and how much of it was taken
    out of them. Two single runs cannot tell a drift of the machine from a change of all cases:
    then all of it is taken out, or as much as the ratio `drift` where that is given. With
    LEAST_RUNS on either side it is taken out unless it is significant among the runs. Where there
    are too few runs to tell how far a case's times differ between them, the spread of the other
    cases' changes tells it: a case is then judged as an outlier among them.
    """
    before, after = pooled(reference), pooled(contender)
    scene_of = {key: scene for run in reference.runs for key, (_, scene) in effects(run).items()}
    members: dict[Key, list[Key]] = {}
    for key in before:
        if key in after and key in scene_of:
            members.setdefault(scene_of[key], []).append(key)
    found, shifts = {}, {}
    several = min(len(reference.runs), len(contender.runs)) >= LEAST_RUNS
    unknown = math.inf
    for scene, keys in members.items():
        ratios = np.array([after[key].level - before[key].level for key in keys])
        shift = taken = float(np.median(ratios))
        if drift is not None:
            taken, unknown = min(max(shift, -math.log(drift)), math.log(drift)), 0.0
        elif several:
            p_value, width = _shifted(reference, contender, keys)
            taken = 0.0 if p_value <= alpha / len(members) else shift
            unknown = abs(taken) + width
        shifts[scene] = shift, taken
        for place, (key, ratio) in enumerate(zip(keys, ratios, strict=True)):
            spread = 0.0
            if not several:
                others = np.delete(ratios, place)
                spread = float(others.var(ddof=1)) if len(others) > 1 else ALONE**2
            found[key] = _change(before[key], after[key], ratio - taken, spread, len(keys))
        if several:
            found |= _steadied({key: found[key] for key in keys})
        found |= {key: replace(found[key], shared=unknown) for key in keys}
    return found, shifts


def _steadied(found: dict[Key, Change]) -> dict[Key, Change]:
    """Changes of one scene, with what their variances tell of each other."""
    variances, freedoms = moderated(
        np.array([one.stderr**2 for one in found.values()]),
        np.array([one.freedom for one in found.values()]),
    )
    return {
        key: Change(one.log_ratio, math.sqrt(variance), float(freedom))
        for (key, one), variance, freedom in zip(found.items(), variances, freedoms, strict=True)
    }


def _shifted(reference: Side, contender: Side, keys: list[Key]) -> tuple[float, float]:
    """The p-value that runs of both sides are equally fast over all these cases; and half the 95 %
    interval of by how much they are not, in logs."""
    levels = [
        [np.median([e[key][0].level for key in keys if key in e]) for e in map(effects, side.runs)]
        for side in (reference, contender)
    ]
    found = stats.ttest_ind(*levels, equal_var=False, nan_policy="omit")
    interval = found.confidence_interval()
    return float(found.pvalue), float(interval.high - interval.low) / 2


def _change(before: Effect, after: Effect, ratio: float, others: float, cases: int) -> Change:
    """Welch's test; or against the variance of the `others`' changes, if that is larger."""
    parts = [(before.variance, before.freedom), (after.variance, after.freedom)]
    if others * cases / max(1, cases - 1) > before.variance + after.variance:
        parts = [(others * cases / max(1, cases - 1), max(1.0, cases - 2.0))]
    variance = sum(part for part, _ in parts)
    spread = sum(part**2 / freedom for part, freedom in parts if freedom > 0)
    freedom = variance**2 / spread if spread else 1.0
    return Change(float(ratio), math.sqrt(variance), freedom)
