"""Measures the error that a case predicts: RMSE over device time, from independent repeats.

A repeat is an estimate of n samples a ray, and its error is known as the reference is. The mean
square of k errors of kurtosis K has the relative standard error sqrt((K - 1) / k), its root half of
that: 16 repeats of 1024 rays whose errors are normal tell the RMSE to 0.6 %. Means of n scores have
an excess kurtosis of 1/n of that of scores, and in a time there is room for 1/n as many: what rare
high scores do to the precision depends on the time spent and hardly on n, so each n gets the same.

A machine that has become slower since the case was measured is no error of its prediction. Repeats
therefore take turns with rounds laid out as those that the prediction is from, and what a repeat
takes is told in units of these. Rounds are disturbed now and then, which makes them longer, never
shorter: of either the lower quartile of times counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freepath.measure.ladder import Ladder
from freepath.measure.rounds import UNITS_PER_LANE, Bench, shape_of
from freepath.measure.runner import SAMPLES_PER_UNIT, Round, Runner
from freepath.measure.stats import relative_half_width

BUDGET_S = 0.32
"""Device time for each sample count, and the rounds that they take turns with."""
TURNS = 8
MOST = 8
"""So many times that is spent where errors or times are not settled by then."""
SETTLED = 0.05
"""Half-width of the 95 % interval of an error, relative; and how far times of every other turn may
be from those between."""
QUIET = 0.25
"""The quantile of times that stands for those of an undisturbed machine."""
REPEATS = 16
"""Repeats at least, so that their spread gives an interval; a multiple of TURNS."""
STEP = 2
"""Between one sample count and the next. A repeat must not hold few samples: starting and ending a
block takes its time, whatever it holds, which the prediction leaves out."""
LEAST_OF_MOST = 8
"""The largest sample count is no smaller."""
UNITS = 1 << 19
"""Estimates of a ray that are held at once."""


@dataclass
class Repeats:
    """What the repeats of one sample count gave."""

    samples: int
    blocks: int
    """Repeats in a turn."""
    squares: list[np.ndarray] = field(default_factory=list)
    """Squared error of each repeat, averaged over rays."""
    times: list[float] = field(default_factory=list)
    """Seconds of a sample in each turn."""

    @property
    def settled(self) -> bool:
        """Whether its error is known well, and its time."""
        width = relative_half_width(np.concatenate(self.squares).tolist()) / 2
        return width <= SETTLED and steady(self.times)


def quiet(times: Sequence[float]) -> float:
    """The time that undisturbed ones have."""
    return float(np.quantile(times, QUIET))


def steady(times: Sequence[float]) -> bool:
    """Whether either half of them tells the same."""
    return abs(quiet(times[::2]) / quiet(times[1::2]) - 1.0) <= SETTLED


def repeats_of(rays: int, lanes_in_all: int, time_per_sample: float) -> list[Repeats]:
    """Lay out repeats of three sample counts; those of the largest just fit the budget.

    A turn keeps all lanes busy, and holds as many repeats as memory allows at most.
    """
    least = max(REPEATS // TURNS, math.ceil(UNITS_PER_LANE * lanes_in_all / rays))
    turn = BUDGET_S / TURNS / (rays * time_per_sample)
    most = int(min(max(turn / least, LEAST_OF_MOST), SAMPLES_PER_UNIT))
    counts = (most // STEP**2, most // STEP, most)
    fit = max(1, UNITS // rays)
    return [Repeats(n, max(least, min(int(turn / n), fit))) for n in counts]


def predicted(row: dict[str, Any], time_s: float) -> float | None:
    """The RMSE that a case's row predicts for so many device seconds a ray; None if unknown."""
    if row["time_to_1pct_s"] is None:
        return None
    ladder = Ladder(row["bias_rms"], row["variance"], row["time_per_sample_s"])
    return ladder.rmse_after(time_s)


def confirmed_rows(row: dict[str, Any], bench: Bench, reference: np.ndarray) -> list[dict]:
    """The rows of confirm.csv for a measured case; reference is shaped as means.

    The samples come after those that the prediction is from, so they are independent of it. Raises
    RunError where a launch fails.
    """
    runner, seconds = bench.timed, row["time_per_sample_s"]
    counts = repeats_of(runner.rays, runner.lanes_in_all, seconds)
    first, beside = bench.measurement.moments.count, []
    per_ray = int(BUDGET_S / TURNS / (runner.rays * seconds))
    shape = shape_of(per_ray, runner.rays, seconds, runner.lanes_in_all)
    for turn in range(1, MOST * TURNS + 1):
        rounds = [runner.run(first, shape.samples, shape.blocks)]
        beside.append(rounds[0].time_per_sample_s)
        for one in counts:
            rounds.append(_taken(one, runner, first, reference))
            first += one.samples * one.blocks
        bench.measurement.time_device_s += sum(one.time_s for one in rounds)
        if turn % TURNS == 0 and steady(beside) and all(one.settled for one in counts):
            break
    return [row | _measured(row, one, quiet(beside)) for one in counts]


def _taken(repeats: Repeats, runner: Runner, first: int, reference: np.ndarray) -> Round:
    one = runner.run(first, repeats.samples, repeats.blocks)
    repeats.squares.append(((one.means - reference) ** 2).reshape(len(one.means), -1).mean(1))
    repeats.times.append(one.time_per_sample_s)
    return one


def _measured(row: dict[str, Any], repeats: Repeats, beside: float) -> dict[str, Any]:
    """What repeats say; `beside` is the time of a sample in the rounds beside them."""
    squares = np.concatenate(repeats.squares)
    square, width = float(squares.mean()), relative_half_width(squares.tolist())
    pace = quiet(repeats.times) / beside
    time_s = pace * repeats.samples * row["time_per_sample_s"]
    return {
        "samples_per_ray": repeats.samples,
        "repeats": len(squares),
        "time_s": time_s,
        "drift": beside / row["time_per_sample_s"],
        "rmse_predicted": predicted(row, time_s),
        "rmse_measured": math.sqrt(square),
        "rmse_low": math.sqrt(square * max(0.0, 1.0 - width)) if square else 0.0,
        "rmse_high": math.sqrt(square * (1.0 + width)) if square else 0.0,
    }
