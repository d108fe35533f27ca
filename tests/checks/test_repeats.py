"""Repeats of a check share what no seed changes, and nothing else."""

import dataclasses
import re

import numpy as np
import pytest
from scipy import stats

from checks.support import CHECKS
from freepath.checks import worker
from freepath.checks.media import MEDIA
from freepath.checks.model import Check
from freepath.checks.outcome import Outcome
from freepath.checks.parts import Lanes
from freepath.checks.repeats import false_alarms, of_devices, small_p_values
from freepath.checks.rig import MOST_SCENES
from freepath.checks.truth import cut, depth_at
from freepath.checks.verdict import (
    Failure,
    NotApplicable,
    chance_of_smallest,
    hearing,
    require,
    sidak,
)
from freepath.scene import cache

BY_NAME = {check.name: check for check in CHECKS}
FIXED = {"orthographic": {"resolution": 4}}


def flight(rig, seed, **axes):
    return rig.with_seed(seed).flight(tracker="delta", **{"medium": "trilinear"} | axes)


def test_a_case_of_a_repeat_differs_by_its_seed_alone(rig):
    one, other = (
        rig.with_seed(seed).case(tracker="ratio", medium="linear", tightness=2) for seed in (5, 6)
    )
    assert (one.seed, other.seed) == (5, 6)
    assert dataclasses.replace(other, seed=5) == one


def test_what_cannot_work_is_told_in_each_repeat(rig):
    for seed in (5, 6):
        with pytest.raises(NotApplicable):
            rig.with_seed(seed).case(tracker="analytic", medium="trilinear")


def test_rays_that_are_drawn_are_drawn_anew_for_each_seed(rig):
    one, other = flight(rig, 5), flight(rig, 6)
    assert not np.array_equal(one.segments, other.segments)
    assert not np.array_equal(one.reference(), other.reference())
    assert np.array_equal(other.reference(), np.exp(-other.depth))


def test_rays_that_are_not_drawn_keep_their_references(rig):
    one, other = flight(rig, 5, rays=FIXED), flight(rig, 6, rays=FIXED)
    assert other.reference() is one.reference()
    assert not np.array_equal(one.run(8).moments.mean, other.run(8).moments.mean)


def test_rays_of_other_estimands_and_media_do_not_share_references(rig):
    usual = flight(rig, 5, rays=FIXED).reference()
    path = flight(rig, 5, rays=FIXED, estimand="free_path").reference()
    linear = flight(rig, 5, rays=FIXED, medium="linear").reference()
    assert not np.allclose(usual, path)
    assert not np.allclose(usual, linear)


def test_a_rig_without_scenes_makes_its_own(rig):
    usual = flight(rig, 5, rays=FIXED)
    assert flight(rig, 5, rays=FIXED).scene is usual.scene
    assert flight(rig.without_scenes(), 5, rays=FIXED).scene is not usual.scene


def test_given_lines_are_told_apart(rig):
    origins, up = np.array([[0.5, 0.5, -1.0]]), np.array([[0.0, 0.0, 1.0]])
    one = flight(rig, 5, lines=(origins, up))
    other = flight(rig, 5, lines=(origins + [0.2, 0.0, 0.0], up))
    assert one.reference() != other.reference()


def test_repeats_do_not_pile_up(rig):
    for seed in range(MOST_SCENES + 8):
        flight(rig, seed, medium="homogeneous", rays={"chords": {"count": 1}})
    assert len(rig._kept) <= MOST_SCENES
    programs, cases = len(rig._programs), len(rig._cases)
    flight(rig, MOST_SCENES + 9, medium="homogeneous", rays={"chords": {"count": 1}})
    assert (len(rig._programs), len(rig._cases)) == (programs, cases)


def test_a_part_reads_the_seed_without_being_compiled_again(rig):
    drawn = []
    for seed in (5, 2**63 + 5):
        body = "rng = stream(seed, in0, 0ul, in0); out0 = rng.s0;"
        (words,) = Lanes(rig.with_seed(seed), 1)(body, [np.arange(8)], ["bits"], 8)
        drawn.append((words, len(rig._programs)))
    assert not np.array_equal(drawn[0][0], drawn[1][0])
    assert drawn[0][1] == drawn[1][1]


@pytest.mark.parametrize("medium", MEDIA)
def test_the_depth_at_a_distance_is_that_of_the_ray_up_to_there(rig, medium):
    made = flight(rig, 5, medium=medium)
    length = made.segments[:, 6:]
    share = np.concatenate([np.random.default_rng(2).random(29), [0.0, 1.0, 1.001, -0.1, np.nan]])
    t = share * length
    t[:, 7] = made.medium.pieces(made.segments).start[:, -1]
    expected = [made.medium.optical_depth(cut(made.segments, at)) for at in t.T]
    found = depth_at(made.medium, made.segments, t)
    np.testing.assert_allclose(found, np.transpose(expected), rtol=1e-13, atol=1e-15)


def test_nothing_is_written_while_the_cache_is_only_read(tmp_path, monkeypatch):
    monkeypatch.setenv("FREEPATH_CACHE", str(tmp_path))
    with cache.reading_only():
        assert cache.cached("one", lambda: np.arange(3)).tolist() == [0, 1, 2]
        assert not list(tmp_path.iterdir())
    cache.cached("one", lambda: np.arange(4))
    with cache.reading_only():
        assert cache.cached("one", lambda: np.arange(3)).tolist() == [0, 1, 2, 3]


def ended(name, p_values, status="Passed"):
    return [
        Outcome(1, name, (), status, 0.0, repeat=repeat, p_value=p_value)
        for repeat, p_value in enumerate(p_values)
    ]


def test_too_many_alarms_are_told():
    outcomes = ended("x", [None] * 5, "Failed")
    assert false_alarms(outcomes, 50)[1]
    assert not false_alarms(outcomes[:1], 1000)[1]


def test_stopped_repeats_tell_no_rate_but_their_p_values():
    outcomes = ended("x", [0.5, 0.005, 0.3, 0.2]) + ended("y", [0.1], "Failed")
    whole, wrong = of_devices({"device": outcomes}, 50)
    assert whole.startswith("device: 1 of 50 runs with fresh seeds raised an alarm")
    assert not wrong
    stopped, wrong = of_devices({"device": outcomes}, 50, stopped=True)
    assert not wrong
    assert "of 50 runs" not in stopped
    assert stopped.splitlines() == [
        "device: stopped, so no run is whole and the rate of false alarms is unknown.",
        "1 of 5 verdicts were alarms.",
        "p-values of 5 verdicts: 1 below 0.01 (expected 0.05), 0 below 0.001 (expected 0.005), "
        "0 below 0.0001 (expected 0.0005).",
    ]


def test_the_chance_of_the_smallest():
    p_values = np.random.default_rng(1).random((100_000, 8))
    found = np.array([chance_of_smallest(one) for one in p_values])
    assert stats.kstest(found, "uniform").pvalue > 1e-3
    assert chance_of_smallest(np.full(8, sidak(1e-7, 8))) == pytest.approx(1e-7, rel=1e-6)


def test_every_test_of_a_check_is_heard(rig):
    def run(rig, alpha):
        require(np.array([0.5, 0.02]), alpha, "one")
        require(np.array([0.3]), alpha, "other")

    status, _, _, p_value = worker.run(rig, Check("x", (), "", run))
    assert status == "Passed"
    assert p_value == pytest.approx(1 - (0.98**2) ** 2)


def test_what_fails_is_heard_and_what_tests_nothing_is_not(rig):
    failing = Check("x", (), "", lambda rig, alpha: require(np.array([1e-9]), alpha, "mean"))
    status, _, text, p_value = worker.run(rig, failing)
    assert (status, p_value) == ("Failed", pytest.approx(1e-9))
    assert "p = 1e-09" in text
    assert worker.run(rig, Check("y", (), "", lambda rig, alpha: None))[3] is None


def test_nothing_is_heard_outside():
    with hearing() as heard:
        require(np.array([0.5]), 0.01, "inside")
    with pytest.raises(Failure):
        require(np.array([0.001]), 0.01, "outside")
    assert heard == [0.5]


def test_a_test_that_is_to_reject_is_not_heard(rig):
    status, _, _, p_value = worker.run(rig, BY_NAME["hard/non-bounding/clamped-bias/delta"])
    assert status == "Passed"
    assert p_value > 1e-6


def test_p_values_as_chance_gives_them_name_no_check():
    rng = np.random.default_rng(2)
    outcomes = [one for i in range(300) for one in ended(f"check-{i}", rng.random(200))]
    text = small_p_values(outcomes)
    assert text.startswith("p-values of 60000 verdicts: ")
    assert "below 0.01 (expected 600)" in text
    assert "too small" not in text


def test_a_check_whose_p_values_are_too_small_is_named_long_before_it_fails():
    rng = np.random.default_rng(3)
    outcomes = [one for i in range(300) for one in ended(f"check-{i}", rng.random(200))]
    # a normal test of a variable with the tails of Student's t of two degrees of freedom
    heavy = 2 * stats.norm.sf(np.abs(stats.t.rvs(2, size=200, random_state=rng)))
    text = small_p_values([*outcomes, *ended("heavy", heavy)])
    (line,) = text.splitlines()[1:]
    assert re.fullmatch(r"  too small too often: heavy: \d+ of 200 below 0.01, .*", line)
