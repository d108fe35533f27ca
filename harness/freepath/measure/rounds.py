"""Measures cases side by side: rounds in random order, until each is precise or out of budget."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from freepath.errors import RunError
from freepath.measure.runner import LAUNCH_S, SAMPLES_PER_UNIT, Round, Runner
from freepath.measure.stats import Moments, Tail
from freepath.measure.stopping import Rule, Stopping

ROUND_S = 0.2
"""Device time aimed at for a round; a budget of few seconds gets shorter ones."""
COUNTING_S = 0.05
"""Device time that counting should take at least."""
EXACTLY_COUNTED = 64
"""Samples of each ray that are counted at least where the number of samples is given."""
COUNTED_IN_ALL = 1 << 16
"""And of all rays together, as far as there are so many: lookups are then known to half a percent,
if they vary as much as they are."""
ENOUGH_S = 0.01
"""Device time from which on a run tells what a sample costs."""
MOST_SAMPLES = 1 << 30
"""No round holds more, and calibration ends there, whatever time a driver says that it takes."""
LEAST_ROUNDS = 10
"""Rounds that a budget is divided into at least."""
UNITS_PER_LANE = 32
"""Units a round should hold for each lane of the device, so that its end leaves few lanes idle."""


@dataclass(frozen=True)
class Shape:
    """How a round is laid out: blocks of samples of every ray. A unit is a block of one ray."""

    samples: int
    blocks: int = 1

    @property
    def per_ray(self) -> int:
        """Samples of each ray in a round."""
        return self.samples * self.blocks


def shape_of(per_ray: int, rays: int, time_per_sample: float, lanes_in_all: int) -> Shape:
    """Lay out a round of about per_ray samples, of two at least, so that it has a variance.

    A unit goes to one lane, so there must be many of them, and none so long that a launch of one
    unit a lane takes longer than a launch should.
    """
    per_ray = max(2, per_ray)
    wanted = math.ceil(UNITS_PER_LANE * lanes_in_all / rays)
    longest = int(LAUNCH_S / 2 / (time_per_sample * lanes_in_all)) if time_per_sample else per_ray
    longest = max(1, min(longest, SAMPLES_PER_UNIT))
    blocks = max(min(wanted, per_ray // 2), math.ceil(per_ray / longest))
    return Shape(per_ray // blocks, blocks)


def exactly(samples: int, shape: Shape) -> Iterator[Shape]:
    """Rounds of one shape, and at most two smaller ones last, with so many samples of each ray."""
    rounds, rest = divmod(samples, shape.per_ray)
    smaller, single = divmod(rest, shape.blocks)
    yield from itertools.repeat(shape, rounds)
    if smaller:
        yield Shape(smaller, shape.blocks)
    if single:
        yield Shape(1, single)


@dataclass
class Measurement:
    """What is known of a case so far."""

    rounds: list[Round] = field(default_factory=list)
    counted: Round | None = None
    moments: Moments | None = None
    tail: Tail = field(default_factory=Tail)
    stopped: str = ""
    """Why it ended: precise, budget, samples or failed; '' while it goes on."""
    spent_s: float = 0.0
    """Wall time of the rounds."""
    time_wall_s: float = 0.0
    """Wall time of calibration, counting and rounds, without building."""
    time_device_s: float = 0.0
    """Device time within that, and within all launches."""
    time_compile_s: float = 0.0
    """What first launches took beyond device time: PoCL compiles for a local size only then."""

    def add(self, one: Round) -> None:
        """Add a measured round; its moments are kept merged only, or they would fill the memory."""
        self.rounds.append(replace(one, moments=None, means=None, squares=None))
        if one.squares is not None and one.samples == self.rounds[0].samples:
            self.tail.add(one.squares)
        self.spent_s += one.time_wall_s
        self.moments = self.moments.merged(one.moments) if self.moments else one.moments

    @property
    def full_rounds(self) -> list[Round]:
        """The rounds of full size, whose times and variances can be compared."""
        return [one for one in self.rounds if one.samples == self.rounds[0].samples]

    @property
    def times(self) -> list[float]:
        """Seconds a sample, of each full round."""
        return [one.time_per_sample_s for one in self.full_rounds]

    @property
    def variances(self) -> list[float]:
        """Variance of one sample, of each full round."""
        return [one.variance for one in self.full_rounds]

    def total(self, counter: str) -> int:
        """A counter over all measured rounds."""
        return sum(one.counters[counter] for one in self.rounds)


class Bench:
    """One case being measured: its timed and its counting kernel, and when it is done."""

    def __init__(self, timed: Runner, counting: Runner, rule: Rule):
        self.timed = timed
        self.counting = counting
        self.rule = rule
        self.measurement = Measurement()
        self._stopping = Stopping(rule)
        self._shapes: Iterator[Shape] = iter(())
        self._next: Shape | None = None
        self._taken = 0

    def prepare(self) -> None:
        """Warm up, find what a round holds, and count."""
        shape = self._calibrated()
        limited = self.rule.samples is not None
        self._shapes = exactly(self.rule.samples, shape) if limited else itertools.repeat(shape)
        self._next = next(self._shapes)
        self.measurement.counted = self._counted()

    def _counted(self) -> Round:
        """Count for a while, or so many samples that exact runs can be compared count by count."""
        if self.rule.samples is None:
            return self.run_for(self.counting, COUNTING_S)
        self._first_run(self.counting)
        wanted = max(EXACTLY_COUNTED, math.ceil(COUNTED_IN_ALL / self.counting.rays))
        return self.run(self.counting, 0, Shape(1, min(self.rule.samples, wanted)))

    def _calibrated(self) -> Shape:
        rays, one = self.timed.rays, self.run_for(self.timed, ENOUGH_S)
        seconds = min(ROUND_S, self.rule.at_most_s / LEAST_ROUNDS)
        wanted = min(int(seconds / one.time_per_sample_s), MOST_SAMPLES) // rays
        if self.rule.samples is not None:
            # the start of each unit takes time, so reruns are comparable where they are laid out
            # alike, whatever the machine was doing while this one was calibrated
            wanted = min(self.rule.samples // self.rule.rounds, MOST_SAMPLES // rays)
        return shape_of(wanted, rays, one.time_per_sample_s, self.timed.lanes_in_all)

    def run_for(self, runner: Runner, seconds: float) -> Round:
        """Run ever more samples until they take so long; returns the last run."""
        one, per_ray = self._first_run(runner), 1
        # by the wall's clock the first run is compilation for the most part
        while one.time_s < seconds or (per_ray == 1 and one.timing_source == "wall"):
            if per_ray * runner.rays >= MOST_SAMPLES:
                break
            per_ray = math.ceil(per_ray * max(2, min(8, 2 * seconds / one.time_s)))
            shape = shape_of(per_ray, runner.rays, one.time_per_sample_s, runner.lanes_in_all)
            one = self.run(runner, 0, shape)
        return one

    def _first_run(self, runner: Runner) -> Round:
        """Run one sample of each ray, and tell apart what compiling takes."""
        started = time.perf_counter()
        one = runner.run(0, 1)
        found = self.measurement
        found.time_compile_s += time.perf_counter() - started - one.time_device_s
        found.time_wall_s += one.time_device_s
        found.time_device_s += one.time_device_s
        return one

    def run(self, runner: Runner, first_sample: int, shape: Shape, **options: Any) -> Round:
        """Take samples of every ray, with the options of `Runner.run`; their time is noted."""
        started = time.perf_counter()
        one = runner.run(first_sample, shape.samples, shape.blocks, **options)
        self.measurement.time_wall_s += time.perf_counter() - started
        self.measurement.time_device_s += one.time_s
        return one

    def step(self) -> None:
        """Measure one round more, and note in the measurement whether and why it was the last."""
        found = self.measurement
        found.add(self.run(self.timed, self._taken, self._next))
        self._taken += self._next.per_ray
        self._next = next(self._shapes, None)
        if self._next is None:
            found.stopped = "samples"
        elif self.rule.samples is None:
            found.stopped = self._stopping.reason(found.times, found.variances, found.spent_s)

    @property
    def progress(self) -> float:
        """A guess in [0, 1] of how far the case is."""
        if self.rule.samples is not None:
            return self._taken / self.rule.samples
        return min(1.0, self.measurement.spent_s / self.rule.at_most_s)


def interleave(
    benches: Iterable[Bench],
    seed: int,
    on_error: Callable[[Bench, RunError | MemoryError], None],
    on_turn: Callable[[Bench], None] = lambda bench: None,
) -> Iterator[Bench]:
    """Run rounds of all cases in random order, anew in each pass; yields the bench of each round.

    A drift of the machine then hits all cases of a pass alike. A case whose launch fails is told
    to on_error and given up; on_turn is told whose turn it is, before its round.
    """
    random = np.random.default_rng(seed)
    active = list(benches)
    while active:
        for place in random.permutation(len(active)).tolist():
            bench = active[place]
            on_turn(bench)
            try:
                bench.step()
            except (RunError, MemoryError) as error:
                bench.measurement.stopped = "failed"
                on_error(bench, error)
            else:
                yield bench
        active = [bench for bench in active if not bench.measurement.stopped]
