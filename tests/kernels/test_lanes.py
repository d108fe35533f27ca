"""The same seed gives the same samples, however many lanes, work-items and launches take them."""

import numpy as np
import pytest

from freepath.checks.identities import check_same_samples

SAMPLES = 2048
TRACKERS = {
    "delta": "delta",
    "ratio": "ratio",
    "regular": "regular",
    "march": {"march": {"step": 0.03, "placement": "jittered"}},
}


def flight(rig, tracker="delta", lanes=16, **options):
    estimand = "transmittance" if tracker == "ratio" else "free_path"
    axes = {"tracker": TRACKERS[tracker], "medium": "trilinear", "majorant": "grid"}
    return rig.flight(**axes, estimand=estimand, lanes=lanes, **options)


def check_same(one, other, rounding, estimand):
    lookups = one.lookups, other.lookups
    check_same_samples(one.score, other.score, lookups, rounding)


@pytest.fixture(scope="module")
def one_lane(rig):
    """Samples of each tracker in one lane, which the others are held against."""
    return {tracker: flight(rig, tracker, 1).record(SAMPLES) for tracker in TRACKERS}


@pytest.mark.parametrize("lanes", [2, 4, 8, 16])
@pytest.mark.parametrize("tracker", TRACKERS)
def test_lanes(rig, one_lane, tracker, lanes):
    many = flight(rig, tracker, lanes)
    check_same(many.record(SAMPLES), one_lane[tracker], many.rounding, many.case.estimand)


def test_lanes_in_double(rig):
    few, many = (flight(rig, lanes=lanes, arithmetic="double") for lanes in (1, 16))
    check_same(few.record(256), many.record(256), many.rounding, "free_path")


@pytest.mark.parametrize("lanes", [1, 16])
@pytest.mark.parametrize("work_items", [(1, 1), (3, 1), (8, 1), (16, 4)], ids=str)
def test_work_items(rig, one_lane, lanes, work_items):
    found = flight(rig, lanes=lanes).record(SAMPLES, work_items=work_items)
    check_same(found, one_lane["delta"], 2.0**-24, "free_path")


@pytest.mark.parametrize(
    ("blocks", "launches"), [(1, 7), (64, 1), (64, 5), (SAMPLES // 2, 1), (1, 1000)]
)
def test_blocks_and_launches(rig, one_lane, blocks, launches):
    found = flight(rig).record(SAMPLES // blocks, blocks, launches=launches)
    check_same(found, one_lane["delta"], 2.0**-24, "free_path")
    totals = found.round.counters, one_lane["delta"].round.counters
    assert totals[0]["lookups"] == pytest.approx(totals[1]["lookups"], rel=1e-5)
    assert totals[0]["steps"] == pytest.approx(totals[1]["steps"], rel=1e-5)
    # moments of blocks, merged, are those of the samples
    scores = found.score
    np.testing.assert_allclose(found.round.moments.mean, scores.mean(axis=1), rtol=1e-6)
    np.testing.assert_allclose(
        found.round.moments.variance, scores.var(axis=1, ddof=1), rtol=1e-4, atol=1e-12
    )


def test_a_later_start_goes_on(rig, one_lane):
    """Rounds of a measurement continue the samples of those before."""
    case = flight(rig)
    halves = [case.record(SAMPLES // 2, first_sample=first) for first in (0, SAMPLES // 2)]
    for half, part in zip(halves, np.split(one_lane["delta"].lookups, 2, axis=1), strict=True):
        assert np.count_nonzero(half.lookups != part) < 1e-5 * part.size
    assert not (halves[0].lookups == halves[1].lookups).all()


@pytest.mark.parametrize("tracker", ["delta", "regular"])
def test_counting_and_recording_change_nothing(rig, one_lane, tracker):
    """The kernel that is timed takes the samples of the one that counts."""
    timed = flight(rig, tracker, count=False, record=False).run(SAMPLES)
    expected = one_lane[tracker].round
    np.testing.assert_allclose(timed.moments.mean, expected.moments.mean, rtol=0, atol=2e-3)
    # a flipped path moves the mean of its own ray only
    differing = np.abs(timed.moments.mean - expected.moments.mean) > 1e-5
    assert np.count_nonzero(differing) <= 1e-5 * timed.samples
    assert timed.counters["lookups"] == 0
    assert timed.counters["steps"] == pytest.approx(expected.counters["steps"], rel=1e-5)


def test_seeds_and_rays_differ(rig, one_lane):
    """Another seed gives other samples; parallel rays through the same medium do not share any."""
    other = flight(rig, seed=1).record(2)
    assert (other.lookups != one_lane["delta"].lookups[:, :2]).mean() > 0.1
    axes = {"tracker": "delta", "medium": "homogeneous", "lanes": 16}
    parallel = rig.flight(**axes, rays={"orthographic": {"resolution": [8, 8]}}).record(64)
    ends = parallel.t[~parallel.escaped]
    assert len(np.unique(ends)) > 0.999 * len(ends)
