"""The rule for times: effects of cases with the machine's drift taken out, and how sure they are.

Rounds of a scene's cases take turns, a round of each in a pass, so a drift of the machine hits all
cases of a pass alike. log(time) = case + pass + noise is fitted robustly (Tukey's median polish),
and what is compared between two runs is the case's part. How far the level of all cases has moved
together is told apart: within what a machine may drift it is no case's fault.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from freepath.compare.pairing import Key, Run, Side, scenes, table_of
from scipy import stats

SWEEPS = 12
"""Of the median polish; it settles within a few."""
BATCHES = 10
"""Neighbouring passes are put together into so many batches, as what disturbs one lasts."""
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

    def p_beyond(self, limit: float) -> tuple[float, float]:
        """One-sided p-values that the ratio is no more than +limit, no less than -limit (logs)."""
        if not self.stderr > 0:
            return float(self.log_ratio <= limit), float(self.log_ratio >= -limit)
        slower = stats.t.sf((self.log_ratio - limit) / self.stderr, self.freedom)
        faster = stats.t.sf((-self.log_ratio - limit) / self.stderr, self.freedom)
        return float(slower), float(faster)


def polished(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit rows + columns to a table with NaN in it; returns row levels and what columns leave.

    The second is the table less its columns' parts, so that each row varies about its level.
    """
    columns = np.zeros(table.shape[1])
    for _ in range(SWEEPS):
        rows = np.nanmedian(table - columns, axis=1)
        columns = np.nanmedian(table - rows[:, None], axis=0)
        columns -= np.median(columns)
    return np.nanmedian(table - columns, axis=1), table - columns


def effects(run: Run) -> dict[Key, tuple[Effect, Key]]:
    """The effect of each case of a run, and the scene that it is of."""
    if run.effects is None:
        run.effects = _effects(run)
    return run.effects


def _effects(run: Run) -> dict[Key, tuple[Effect, Key]]:
    found = {}
    for scene, keys in scenes(run).items():
        table = table_of([run.times[key] for key in keys])
        adjusted = polished(table)[1] if len(keys) > 2 else table
        for key, row in zip(keys, adjusted, strict=True):
            found[key] = _effect(row[np.isfinite(row)]), scene
    return found


def _effect(values: np.ndarray) -> Effect:
    """Level and its variance from batches of neighbours; a mean of medians, robust and normal."""
    count = min(BATCHES, len(values))
    batches = np.array([np.median(batch) for batch in np.array_split(values, count)])
    return Effect(float(batches.mean()), float(batches.var(ddof=1)) / count, count - 1.0)


def pooled(side: Side) -> dict[Key, Effect]:
    """The effect of each case of a side, scene by scene less what all cases have in common."""
    runs = [effects(run) for run in side.runs]
    found = {}
    for key in {key for run in runs for key in run}:
        given = [run[key][0] for run in runs if key in run]
        levels = np.array([effect.level for effect in given])
        if len(given) >= LEAST_RUNS:
            found[key] = Effect(levels.mean(), levels.var(ddof=1) / len(given), len(given) - 1.0)
        else:
            variance = sum(effect.variance for effect in given) / len(given) ** 2
            found[key] = Effect(levels.mean(), variance, sum(e.freedom for e in given))
    return found


def changes(reference: Side, contender: Side, drift: float) -> tuple[dict[Key, Change], dict]:
    """The change of each case that both sides measured, and the shift of each scene.

    What all cases of a scene shift together (a median) is taken out of them as far as it is less
    than `drift`, a ratio: two runs of a machine differ by that much without a reason. Where there
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
    pooled_runs = min(len(reference.runs), len(contender.runs)) >= LEAST_RUNS
    for scene, keys in members.items():
        ratios = np.array([after[key].level - before[key].level for key in keys])
        shift = float(np.median(ratios))
        shifts[scene] = shift
        limit = math.log(drift)
        # of one or two cases nothing tells the machine from the case: the drift is uncertainty
        known = len(keys) > 2
        taken = min(max(shift, -limit), limit) if known else 0.0
        further = (limit / 2) ** 2 if not known else 0.0
        for place, (key, ratio) in enumerate(zip(keys, ratios, strict=True)):
            if known and not pooled_runs:
                further = float(np.delete(ratios, place).var(ddof=1))
            found[key] = _change(before[key], after[key], ratio - taken, further, len(keys))
    return found, shifts


def _change(before: Effect, after: Effect, ratio: float, further: float, cases: int) -> Change:
    """Welch's test, with what is known of the spread between runs added."""
    parts = [(before.variance, before.freedom), (after.variance, after.freedom)]
    if further:
        parts.append((further, max(1.0, cases - 2.0)))
    variance = sum(part for part, _ in parts)
    spread = sum(part**2 / freedom for part, freedom in parts if freedom > 0)
    freedom = variance**2 / spread if spread else 1.0
    return Change(float(ratio), math.sqrt(variance), freedom)
