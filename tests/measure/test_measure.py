"""Measuring, with a made-up kernel instead of a device: its times and scores are known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from freepath.device.opencl import COUNTERS
from freepath.errors import RunError
from freepath.measure import rounds as measure
from freepath.measure.rounds import Bench, Shape, exactly, interleave, shape_of
from freepath.measure.runner import LAUNCH_S, SAMPLES_PER_UNIT, Round
from freepath.measure.stats import Moments
from freepath.measure.stopping import Rule


class MadeUp:
    """A runner whose samples take a given time, and which remembers what it was asked for."""

    def __init__(self, rays=16, seconds=1e-6, *, spread=0.0, source="device", lanes=128):
        self.rays = rays
        self.lanes_in_all = lanes
        self.seconds = seconds
        self.spread = spread
        self.source = source
        self.runs = []
        self.broken_after = math.inf
        self._random = np.random.default_rng(1)

    def run(self, first_sample, samples, blocks=1):
        self.runs.append((first_sample, samples, blocks))
        if len(self.runs) > self.broken_after:
            raise RunError("the device went away")
        per_ray = samples * blocks
        count = per_ray * self.rays
        seconds = self.seconds * count * (1 + self.spread * self._random.normal())
        scores = np.full(self.rays, 0.5)
        return Round(
            samples=count,
            estimate=0.5,
            variance=0.25 if per_ray > 1 else None,
            counters=dict.fromkeys(COUNTERS, 0) | {"steps": count},
            iterations=count,
            time_device_s=seconds if self.source == "device" else 0.0,
            time_wall_s=seconds,
            timing_source=self.source,
            moments=Moments(per_ray, scores, np.full(self.rays, 0.25 * max(per_ray - 1, 1))),
        )


def bench_of(timed, *, error=0.01, time_noise=0.02, at_most_s=10.0, samples=None):
    counting = MadeUp(timed.rays, 3 * timed.seconds)
    bench = Bench(timed, counting, Rule(error, time_noise, at_most_s, samples))
    bench.prepare()
    timed.prepared = len(timed.runs)
    return bench


def measured(bench):
    while not bench.measurement.stopped:
        bench.step()
    return bench.measurement


@pytest.mark.parametrize("rays", [1, 5, 4096, 10**6])
@pytest.mark.parametrize("per_ray", [0, 2, 7, 1000, 10**6])
@pytest.mark.parametrize("seconds", [1e-9, 1e-6, 1e-3])
def test_the_shape_of_a_round(rays, per_ray, seconds):
    shape = shape_of(per_ray, rays, seconds, 128)
    assert 2 <= shape.per_ray <= max(2, per_ray)
    assert shape.per_ray > 0.5 * per_ray
    assert shape.samples <= SAMPLES_PER_UNIT
    # a launch of one unit a lane is no longer than a launch should be, if it can be helped
    assert shape.samples == 1 or shape.samples * 128 * seconds <= LAUNCH_S
    # enough units for all lanes, if there are samples for them
    assert shape.blocks * rays >= min(measure.UNITS_PER_LANE * 128, per_ray // 2 * rays)


@pytest.mark.parametrize("samples", [700, 703, 1000, 7919, 65537])
@pytest.mark.parametrize("shape", [Shape(2), Shape(1, 2), Shape(3, 5), Shape(100, 7)])
def test_an_exact_number_of_samples(samples, shape):
    shapes = list(exactly(samples, shape))
    assert sum(one.per_ray for one in shapes) == samples
    full = [one for one in shapes if one == shape]
    assert len(shapes) - len(full) <= 2
    assert shapes[: len(full)] == full


@pytest.mark.parametrize("rays", [1, 16, 4096])
@pytest.mark.parametrize("samples", [2, 3, 10, 999, 7919])
def test_a_config_may_ask_for_an_exact_number(rays, samples):
    found = measured(bench_of(MadeUp(rays), samples=samples))
    assert found.stopped == "samples"
    assert found.moments.count == samples
    assert sum(one.samples for one in found.rounds) == samples * rays
    assert len(found.full_rounds) >= min(10, samples // 2)


@pytest.mark.parametrize("samples", [None, 7919])
def test_rounds_take_each_sample_once(samples):
    timed = MadeUp(spread=0.05)
    found = measured(bench_of(timed, samples=samples, at_most_s=3.0))
    assert len(found.rounds) > 5
    expected = 0
    for first, per_unit, blocks in timed.runs[timed.prepared :]:
        assert first == expected
        expected += per_unit * blocks
    assert found.moments.count == expected


def test_a_steady_case_is_precise_after_the_pilot_rounds():
    found = measured(bench_of(MadeUp()))
    assert (found.stopped, len(found.rounds)) == ("precise", 5)
    assert found.times == pytest.approx([1e-6] * 5)


def test_a_round_takes_about_as_long_as_it_should():
    for seconds in (1e-9, 1e-7, 1e-5):
        found = measured(bench_of(MadeUp(4096, seconds)))
        for one in found.rounds:
            assert one.time_s == pytest.approx(measure.ROUND_S, rel=0.5)


def test_a_small_budget_has_small_rounds():
    found = measured(bench_of(MadeUp(spread=1.0), time_noise=1e-6, at_most_s=0.5))
    assert found.stopped == "budget"
    assert len(found.rounds) >= 9
    assert found.spent_s == pytest.approx(0.5, rel=0.3)


def test_a_round_longer_than_the_budget_is_the_only_one():
    found = measured(bench_of(MadeUp(10**6, 1e-5), at_most_s=1.0))
    assert (found.stopped, len(found.rounds)) == ("budget", 1)
    assert found.rounds[0].samples == 2 * 10**6


def test_preparing_a_dear_case_takes_one_sample_of_each_ray():
    timed = MadeUp(10**6, 1e-5)
    bench = bench_of(timed)
    assert timed.runs == [(0, 1, 1)]
    assert bench.counting.runs == [(0, 1, 1)]
    assert bench.measurement.counted.samples == 10**6


def test_an_exact_number_of_samples_is_counted_exactly():
    """However fast the machine is, so that two runs can be compared count by count."""
    for seconds in (1e-8, 1e-6):
        bench = bench_of(MadeUp(10, seconds), samples=1000)
        assert bench.measurement.counted.samples == 10 * 1000
    many = bench_of(MadeUp(4096), samples=1000).measurement.counted
    assert many.samples == 4096 * measure.EXACTLY_COUNTED
    assert bench_of(MadeUp(10), samples=7).measurement.counted.samples == 70


def test_a_single_ray_is_counted_over_many_samples():
    """64 samples of it, which vary as much as they are, would tell lookups to 12 %."""
    counted = bench_of(MadeUp(1), samples=200_000).measurement.counted
    assert counted.samples == measure.COUNTED_IN_ALL


def test_a_cheap_case_is_counted_for_a_while():
    bench = bench_of(MadeUp())
    counted = bench.measurement.counted
    assert measure.COUNTING_S <= counted.time_s <= 4 * measure.COUNTING_S
    assert {first for first, _, _ in bench.counting.runs} == {0}


def test_a_first_run_by_the_wall_tells_nothing_of_the_cost():
    class Compiling(MadeUp):
        def run(self, *arguments):
            one = super().run(*arguments)
            first = len(self.runs) == 1
            return replace(one, time_wall_s=one.time_wall_s + 2.0) if first else one

    found = measured(bench_of(Compiling(4096, 1e-7, source="wall")))
    assert found.rounds[0].time_s == pytest.approx(measure.ROUND_S, rel=0.5)


def test_what_compiling_takes_is_not_time_of_measuring(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(measure.time, "perf_counter", lambda: now[0])

    class Slow(MadeUp):
        def run(self, *arguments):
            one = super().run(*arguments)
            now[0] += one.time_wall_s + (3.0 if len(self.runs) == 1 else 0.0)
            return one

    bench = Bench(Slow(), Slow(), Rule(0.01, 0.02, 10.0))
    bench.prepare()
    found = measured(bench)
    assert found.time_compile_s == pytest.approx(6.0)
    assert found.time_wall_s == pytest.approx(found.time_device_s)


def test_a_driver_that_reports_no_time_does_not_calibrate_for_ever():
    timed = MadeUp(rays=1 << 20, seconds=1e-15)
    shape_of_round = bench_of(timed)._next
    assert shape_of_round.per_ray * timed.rays <= measure.MOST_SAMPLES
    assert len(timed.runs) < 30


def test_rounds_are_interleaved_in_random_order():
    order = []

    class Telling(MadeUp):
        def __init__(self, name):
            super().__init__()
            self.name = name

        def run(self, *arguments):
            order.append(self.name)
            return super().run(*arguments)

    benches = [bench_of(Telling(name), samples=1000) for name in "abcdef"]
    order.clear()
    ended = [
        bench.timed.name for bench in interleave(benches, 7, None) if bench.measurement.stopped
    ]
    assert sorted(ended) == list("abcdef")
    passes = [order[i : i + 6] for i in range(0, 60, 6)]
    assert all(sorted(one) == list("abcdef") for one in passes)
    assert len({tuple(one) for one in passes}) > 5


def test_the_order_is_the_same_for_the_same_seed():
    def order(seed):
        benches = [bench_of(MadeUp(rays), samples=100) for rays in range(1, 9)]
        return [bench.timed.rays for bench in interleave(benches, seed, None)]

    assert order(1) == order(1) != order(2)


def test_a_case_that_fails_does_not_stop_the_others():
    failing, fine = bench_of(MadeUp(), samples=100), bench_of(MadeUp(), samples=100)
    failing.timed.broken_after = len(failing.timed.runs) + 3
    failed = []
    steps = list(interleave([failing, fine], 1, lambda bench, error: failed.append((bench, error))))
    assert [(bench, str(error)) for bench, error in failed] == [(failing, "the device went away")]
    assert steps.count(failing) == 3
    assert steps.count(fine) == 10
    assert (failing.measurement.stopped, fine.measurement.stopped) == ("failed", "samples")


def test_progress_goes_from_nothing_to_all():
    bench = bench_of(MadeUp(), samples=100)
    seen = [bench.progress]
    while not bench.measurement.stopped:
        bench.step()
        seen.append(bench.progress)
    assert seen == sorted(seen)
    assert (seen[0], seen[-1]) == (0.0, 1.0)


def test_an_exact_number_is_laid_out_alike_however_fast_the_machine_is():
    layouts = []
    for seconds in (1e-9, 1e-7, 1e-6):
        bench = Bench(MadeUp(7, seconds), MadeUp(7), Rule(0.01, 0.02, 0.005, 10_000, 40))
        bench.prepare()
        found = measured(bench)
        layouts.append([one.samples for one in found.rounds])
    assert layouts[0] == layouts[1] == layouts[2]
    assert len(layouts[0]) >= 40
