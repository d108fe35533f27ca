import json

import numpy as np
import pytest

from freepath import config
from freepath.cases import plan
from freepath.compose import catalog, source
from freepath.measure import binding
from freepath.measure.rounds import Bench
from freepath.measure.runner import LAUNCH_S, KernelData, Pace
from freepath.measure.stopping import Rule
from freepath.scene import build_medium


def test_the_first_launch_is_small_and_the_next_grow():
    pace, launches, left = Pace(128), [], 10**6
    while left:
        samples = pace.fit(left)
        launches.append(samples)
        pace.took(samples, samples * 1e-9)
        left -= samples
    assert launches[:4] == [128, 512, 2048, 8192]
    assert sum(launches) == 10**6


def test_launches_keep_below_the_limit():
    pace = Pace(128)
    pace.took(128, 1e-3)
    assert pace.fit(10**9) == 512
    pace.took(10**6, 1.0)  # too long: 1 us a sample
    assert pace.fit(10**9) == int(LAUNCH_S / 2 * 1e6)
    assert pace.fit(200_000) == 200_000  # as one, since it fits
    assert pace.fit(300_000) == int(LAUNCH_S / 2 * 1e6)


def test_launches_become_smaller_where_samples_become_dear():
    pace = Pace(128)
    pace.took(10**6, 0.1)
    pace.took(10**6, 1.0)
    assert pace.fit(10**7) == int(LAUNCH_S / 2 * 1e6)
    pace.took(10, 10.0)
    assert pace.fit(10**7) == 0  # what a runner raises to a unit for each lane


@pytest.fixture(scope="module")
def runner_of(device, tmp_path_factory):
    """Make the runner of a case in an empty medium, and note how long its launches take."""
    folder = tmp_path_factory.mktemp("runner")
    known = catalog.load()

    def make(tracker, rays, count=False, **axes):
        matrix = {"medium": {"homogeneous": {"sigma_t": 1.0}}, "tracker": tracker} | axes
        (folder / "x.yaml").write_text(json.dumps({"name": "x", "rays": rays, "matrix": matrix}))
        loaded = config.load(folder / "x.yaml", known.parameter_models())
        (case,) = plan.expand(loaded, known)
        scene = binding.Scene.of(case, build_medium(case.medium), [])
        structure = binding.structure_of(case, known, scene.medium, device, count=count)
        program = device.build(source.compose(structure))
        data = KernelData.upload(device, scene.segments, scene.medium.data, case.arithmetic)
        runner = binding.runner_of(case, structure, scene, program, data)
        seconds, launch = [], program.launch
        program.launch = lambda *arguments: seconds.append(launch(*arguments)) or seconds[-1]
        return runner, seconds

    return make


SINGLE = {"single": {"origin": [0.5, 0.5, -1], "direction": [0, 0, 1]}}


def square(side):
    return {"orthographic": {"resolution": [side, side]}}


def test_launches_are_cut_also_for_many_rays_and_dear_samples(runner_of):
    """2^16 rays of 2^13 steps each take seconds; nothing of their cost is known at first."""
    runner, seconds = runner_of({"march": {"step": 1 / 8192}}, square(256))
    one = runner.run(0, 1)
    assert one.time_s == pytest.approx(sum(seconds))
    assert one.samples == 1 << 16
    if one.time_s > 1.0:
        assert len(seconds) > 4
    # a machine that is busy with other things takes longer now and then
    assert np.quantile(seconds, 0.9) < 2 * LAUNCH_S


def test_the_cut_does_not_change_the_samples(runner_of):
    runner, seconds = runner_of("delta", square(16), count=True)
    found = [runner.run(5, 8, 3, launches=cut) for cut in (None, 1, 7, 1000)]
    for one in found[1:]:
        assert one.counters == found[0].counters
        assert (one.moments.mean == found[0].moments.mean).all()
    assert len(seconds) > 1 + 7 + 256 * 3 - 1


def test_rounds_follow_each_other(runner_of):
    """Two rounds have the samples of one that is twice as long."""
    runner, _ = runner_of("delta", square(8), count=True)
    both, first, second = runner.run(0, 20), runner.run(0, 10), runner.run(10, 10)
    merged = first.moments.merged(second.moments)
    np.testing.assert_allclose(merged.mean, both.moments.mean, rtol=1e-6)
    np.testing.assert_allclose(merged.m2, both.moments.m2, rtol=1e-5, atol=1e-6)
    for counter, count in both.counters.items():
        assert count == first.counters[counter] + second.counters[counter]


def test_a_single_ray_keeps_all_lanes_at_work(runner_of):
    bench = Bench(*(runner_of("delta", SINGLE, count)[0] for count in (False, True)), RULE)
    bench.prepare()
    bench.step()
    (one,) = bench.measurement.rounds
    lanes = bench.timed.lanes
    assert one.counters["steps"] / (one.iterations * lanes) > 0.9
    assert one.samples > 10_000


RULE = Rule(error=0.01, time_noise=0.02, at_most_s=1.0)


def test_one_sample_of_a_ray_has_no_variance(runner_of):
    runner, _ = runner_of("delta", square(8), count=True)
    assert runner.run(0, 1).variance is None
    assert runner.run(0, 1, 2).variance is not None


def test_cases_share_what_they_read_and_write(runner_of):
    runner, _ = runner_of("delta", square(8), count=True)
    data = runner.data
    small = data.output("moments", 100)
    assert data.output("moments", 50) is small
    assert data.output("moments", 10**6) is not small
    kept = data.keep(("grid", 1.0), np.ones(3))
    assert data.keep(("grid", 1.0), np.ones(3)) is kept
    assert data.keep(("grid", 2.0), np.ones(3)) is not kept
