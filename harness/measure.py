"""Measures cases side by side: rounds in random order, until each case is precise or out of budget."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from freepath.errors import RunError
from freepath.runner import SAMPLES_PER_UNIT, Round, Runner
from freepath.stats import Moments, relative_half_width

ROUND_S = 0.2
"""Device time aimed at for a round; a budget of few seconds gets shorter ones."""
LAUNCH_S = 0.25
"""Device time that no launch should exceed."""
PILOT_ROUNDS = 5
"""Rounds after which the number that the wanted error needs is fixed: stopping as soon as an estimate
looks precise would favour lucky ones."""
UNITS_PER_LANE = 32
"""Units a launch should hold for each lane of the device, so that its end leaves few lanes idle."""


@dataclass(frozen=True)
class Rule:
    """When a case has been measured enough."""

    error: float
    """Half-width of the 95 % interval of the RMSE of one sample, relative."""
    time_noise: float
    """Half-width of the 95 % interval of the time of one sample, relative."""
    at_most_s: float
    """Seconds of rounds after which a case stops whatever its precision."""
    samples: int | None = None
    """Exactly this many samples of each ray, instead of the three others."""


@dataclass(frozen=True)
class Shape:
    """How a round is laid out: blocks of samples of every ray, cut into launches."""

    samples: int
    blocks: int
    launches: int

    @property
    def per_ray(self) -> int:
        """Samples of each ray in a round."""
        return self.samples * self.blocks


def shape_of(per_ray: int, rays: int, time_per_sample: float, lanes_in_all: int) -> Shape:
    """Lay out a round of about per_ray samples; at least two a unit, so that it has a variance."""
    wanted = math.ceil(UNITS_PER_LANE * lanes_in_all / rays)
    blocks = max(1, min(wanted, per_ray // 2), math.ceil(per_ray / SAMPLES_PER_UNIT))
    samples = max(2, min(per_ray // blocks, SAMPLES_PER_UNIT))
    launches = math.ceil(samples * blocks * rays * time_per_sample / LAUNCH_S)
    return Shape(samples, blocks, max(1, launches))


@dataclass
class Measurement:
    """What is known of a case so far."""

    rounds: list[Round] = field(default_factory=list)
    counted: Round | None = None
    moments: Moments | None = None
    stopped: str = ""
    """Why it ended: precise, budget or samples."""
    time_wall_s: float = 0.0
    """Wall time of calibration, counting and rounds, without building."""
    time_device_s: float = 0.0
    """Device time within that, and within all launches."""

    def add(self, one: Round) -> None:
        """Add a measured round; its moments are kept merged only, or they would fill the memory."""
        self.rounds.append(replace(one, moments=None))
        self.moments = self.moments.merged(one.moments) if self.moments else one.moments

    @property
    def times(self) -> list[float]:
        """Seconds a sample, of each round."""
        return [one.time_s / one.samples for one in self.rounds]

    def total(self, counter: str) -> int:
        """A counter over all measured rounds."""
        return sum(one.counters[counter] for one in self.rounds)


class Bench:
    """One case being measured: its counting and its timed kernel, and when it is done."""

    def __init__(self, counting: Runner, timed: Runner, rule: Rule, lanes_in_all: int):
        self.counting = counting
        self.timed = timed
        self.rule = rule
        self.measurement = Measurement()
        self._lanes_in_all = lanes_in_all
        self._shape: Shape | None = None
        self._rounds_for_error = 0
        self.time_compile_s = 0.0

    def _first_run(self, runner: Runner, shape: Shape) -> None:
        """Launch for the first time: PoCL compiles for a local size only then, which is build time."""
        started = time.perf_counter()
        one = runner.run(0, shape.samples, shape.blocks, launches=shape.launches)
        self.time_compile_s += time.perf_counter() - started - one.time_device_s
        self.measurement.time_wall_s += one.time_device_s
        self.measurement.time_device_s += one.time_device_s

    def _run(self, runner: Runner, first_sample: int, shape: Shape) -> Round:
        started = time.perf_counter()
        one = runner.run(first_sample, shape.samples, shape.blocks, launches=shape.launches)
        self.measurement.time_wall_s += time.perf_counter() - started
        self.measurement.time_device_s += one.time_s
        return one

    def prepare(self) -> None:
        """Find a round's size, count one round, and warm the timed kernel up at that size."""
        shape = self._calibrated()
        self.measurement.counted = self._run(self.counting, 0, shape)
        self._first_run(self.timed, Shape(2, 1, shape.launches))
        self._shape = shape

    def _calibrated(self) -> Shape:
        rays = self.timed.rays
        # Cut small at first: what a sample costs is not known yet.
        shape = Shape(2, 1, math.ceil(rays / 1024))
        self._first_run(self.counting, shape)
        per_sample = self._seconds_per_sample(shape)
        while per_sample * shape.per_ray * rays < 0.01:
            grown = shape_of(4 * shape.per_ray, rays, per_sample, self._lanes_in_all)
            if grown.per_ray <= shape.per_ray:
                break
            shape = grown
            per_sample = self._seconds_per_sample(shape)
        if self.rule.samples is not None:
            per_ray = _share_of(self.rule.samples)
            blocks = next(b for b in range(1, per_ray + 1) if _divides(b, per_ray))
            return Shape(per_ray // blocks, blocks, shape.launches)
        wanted = min(ROUND_S, self.rule.at_most_s / 10) / (per_sample * rays)
        return shape_of(max(2, int(wanted)), rays, per_sample, self._lanes_in_all)

    def _seconds_per_sample(self, shape: Shape) -> float:
        one = self._run(self.counting, 0, shape)
        return one.time_s / one.samples

    def step(self) -> Round:
        """Measure one round more."""
        first = len(self.measurement.rounds) * self._shape.per_ray
        one = self._run(self.timed, first, self._shape)
        self.measurement.add(one)
        return one

    @property
    def done(self) -> bool:
        """Whether the rule is fulfilled; notes why."""
        self.measurement.stopped = self._why_done()
        return bool(self.measurement.stopped)

    def _why_done(self) -> str:
        rounds = self.measurement.rounds
        if self.rule.samples is not None:
            return "samples" if len(rounds) * self._shape.per_ray >= self.rule.samples else ""
        if len(rounds) == PILOT_ROUNDS:
            self._rounds_for_error = self._plan_rounds()
        if len(rounds) >= PILOT_ROUNDS and len(rounds) >= self._rounds_for_error:
            if relative_half_width(self.measurement.times) <= self.rule.time_noise:
                return "precise"
        spent = sum(one.time_wall_s for one in rounds)
        return "budget" if spent >= self.rule.at_most_s else ""

    def _plan_rounds(self) -> int:
        """How many rounds the wanted interval of the RMSE takes, from the spread of the pilot's."""
        variances = [one.variance for one in self.measurement.rounds]
        if not any(variances):
            return 0
        # The RMSE is the root of the variance: half its relative error.
        half_width = relative_half_width(variances) / 2
        if not math.isfinite(half_width):
            return PILOT_ROUNDS
        return math.ceil(PILOT_ROUNDS * (half_width / self.rule.error) ** 2)

    @property
    def progress(self) -> float:
        """A guess in [0, 1] of how far the case is."""
        rounds = self.measurement.rounds
        if self.rule.samples is not None:
            return min(1.0, len(rounds) * self._shape.per_ray / self.rule.samples)
        return min(1.0, sum(one.time_wall_s for one in rounds) / self.rule.at_most_s)


def _share_of(samples: int) -> int:
    """The samples of a round such that up to ten equal rounds give exactly the wanted number."""
    return next(samples // k for k in range(10, 0, -1) if samples % k == 0 and samples // k >= 2)


def _divides(blocks: int, per_ray: int) -> bool:
    return per_ray % blocks == 0 and per_ray // blocks <= SAMPLES_PER_UNIT


def interleave(
    benches: dict[int, Bench],
    seed: int,
    on_round: Callable[[int, Round], None],
    on_error: Callable[[int, RunError], None],
) -> Iterator[int]:
    """Run rounds of all cases in random order, anew in each pass; yields each case as it is done.

    A drift of the machine then hits all cases of a pass alike. A case whose launch fails is told to
    on_error and given up.
    """
    random = np.random.default_rng(seed)
    active = list(benches)
    while active:
        for key in random.permutation(active).tolist():
            try:
                on_round(key, benches[key].step())
            except RunError as error:
                active.remove(key)
                on_error(key, error)
                continue
            if benches[key].done:
                active.remove(key)
                yield key
