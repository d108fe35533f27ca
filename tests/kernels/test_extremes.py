"""Thin, thick, loose and non-bounding: exact, unbiased, or reported as what they are."""

import numpy as np
import pytest
from freepath.check.cases import check_samples
from freepath.check.identities import check_clean, check_mean
from freepath.runner import STEP_CAP

FEW = {"chords": {"count": 16}}
GRID = {"grid": {"resolution": [5, 3, 4]}}
EVERY = [
    ("analytic", "global"), ("regular", "global"), ("march", "global"),
    ("delta", "global"), ("delta", GRID), ("ratio", "global"), ("ratio", GRID),
]  # fmt: skip
EACH = pytest.mark.parametrize(
    ("tracker", "majorant"), EVERY, ids=lambda v: v if v != GRID else "grid"
)
UPWARD = {"orthographic": {"resolution": [4, 4]}}


def homogeneous(rig, tracker, sigma_t, majorant="global", **options):
    medium = {"homogeneous": {"sigma_t": sigma_t}}
    return rig.flight(tracker=tracker, medium=medium, majorant=majorant, lanes=16, **options)


@EACH
def test_thick(rig, tracker, majorant):
    """An optical depth of 1000: a transmittance of 0, which is not 0 / 0."""
    samples = homogeneous(rig, tracker, 1e3, majorant, rays=UPWARD).record(8)
    check_clean(samples.round, bounded=True)
    assert (samples.score == 0.0).all()
    assert samples.round.estimate == samples.round.variance == 0.0


@pytest.mark.parametrize("tracker", ["analytic", "regular", "delta"])
def test_very_thick(rig, tracker):
    """An optical depth of a million, and free paths that still add up."""
    estimand = {"estimand": "free_path"}
    flight = homogeneous(rig, tracker, 1e6, rays=UPWARD, **estimand)
    samples = flight.record(2048)
    check_samples(flight, samples, 1e-4)
    assert not samples.escaped.any()


def test_ratio_in_a_very_thick_medium(rig):
    """It goes on to the end of a ray when all its weight is gone: a million lookups a path."""
    samples = homogeneous(rig, "ratio", 1e6, rays={"orthographic": {"resolution": 1}}).record(4)
    check_clean(samples.round, bounded=True)
    assert (samples.weight == 0.0).all()
    assert samples.lookups.mean() == pytest.approx(1e6, rel=0.01)


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
@pytest.mark.parametrize("tracker", ["regular", "delta", "ratio"])
def test_contrast(rig, tracker, interpolation):
    """Neighbouring voxels of 0 and 10^6, of a denormal density, and of one."""
    voxels = np.zeros((4, 4, 4))
    voxels[1, 2, 1::2], voxels[2, 1, :], voxels[3, 3, :] = 1e6, 1e-42, 1.0
    medium = rig.volume(voxels, voxel_size=0.25, interpolation=interpolation)
    middles = (np.arange(4) + 0.5) / 4
    y, z = (place.ravel() for place in np.meshgrid(middles, middles))
    origins = np.column_stack([np.full(16, -1.0), y, z])
    lines = origins, np.tile([1.0, 0.0, 0.0], (16, 1))
    grid = {"grid": {"resolution": 4}}
    flight = rig.flight(tracker=tracker, medium=medium, majorant=grid, lines=lines, lanes=16)
    # few, as paths of a million lookups are bound to be where the majorant is that of a neighbour
    samples = flight.record(2)
    check_clean(samples.round, bounded=True)
    expected = flight.reference()
    thick = expected < 1e-30
    assert np.count_nonzero(thick) == 1
    assert (samples.score[thick] == 0.0).all()
    if tracker == "regular":
        check_samples(flight, samples, 1e-4)
    else:
        # a weight of 1 - 1e-6 a lookup is too fine for float32, and there are up to 10^6 of them
        clear = expected > 0.99
        assert np.count_nonzero(clear) > 4
        assert (np.abs(samples.weight[clear] - 1.0) < 1e-3).all()


@EACH
def test_thin(rig, tracker, majorant):
    """Of a medium that takes 10^-5, the share that it takes is right, not only what it leaves."""
    tightness = 1e4 if tracker == "ratio" else 1.0  # often enough a collision, to see its weight
    flight = homogeneous(rig, tracker, 1e-5, majorant, tightness=tightness)
    moments = flight.record(2048, blocks=4).round.moments
    taken, expected = (1.0 - moments.mean).mean(), (1.0 - flight.reference()).mean()
    error = np.sqrt((moments.variance / moments.count).sum()) / len(moments.mean)
    # a single score is rounded to 2^-24: half of a percent of what is taken
    assert abs(taken - expected) < 5.0 * error + 2.0**-25
    if tracker == "ratio":
        assert error < 0.005 * expected
        variance = np.expm1(1e-5 * flight.segments[:, 6] / tightness)
        assert moments.variance.mean() == pytest.approx(variance.mean(), rel=0.02)


@pytest.mark.parametrize("majorant", ["global", GRID], ids=["global", "grid"])
@pytest.mark.parametrize("tracker", ["delta", "ratio"])
def test_loose(rig, tracker, majorant):
    """A majorant a thousand times too high costs time, nothing else."""
    flight = rig.flight(
        tracker=tracker, medium="layered", majorant=majorant, tightness=1000, lanes=16, rays=FEW
    )
    check_samples(flight, flight.record(512), 1e-4)


def test_the_step_cap_is_reported(rig):
    """Paths that would take more steps than the cap are cut off, and all of them counted."""
    flight = homogeneous(rig, "ratio", 1.0, tightness=1e8, rays=UPWARD)
    one = flight.run(1)
    assert one.counters["truncated"] == one.samples == 16
    assert one.counters["steps"] == 16 * STEP_CAP
    assert one.counters["nonfinite"] == 0
    # just below the cap nothing is
    one = homogeneous(rig, "ratio", 1.0, tightness=1e6, rays=UPWARD).run(1)
    assert one.counters["truncated"] == 0
    assert one.counters["steps"] == pytest.approx(16e6, rel=0.01)


@pytest.mark.parametrize("majorant", ["global", "grid"])
@pytest.mark.parametrize("medium", ["layered", "trilinear"])
def test_a_majorant_that_does_not_bound(rig, medium, majorant):
    """Delta tracking reports it; ratio tracking is unbiased, its weights change their signs."""
    axes = {"medium": medium, "majorant": majorant, "lanes": 16}
    delta = rig.flight(**axes, tracker="delta", tightness=0.5).record(1024)
    assert delta.round.counters["violations"] > 1000
    tight = rig.flight(**axes, tracker="delta", tightness=1).record(1024)
    assert tight.round.counters["violations"] == 0

    flight = rig.flight(**axes, tracker="ratio", tightness=0.8)
    samples = flight.record(1024, blocks=2)
    assert (samples.weight < 0.0).any()
    assert samples.round.counters["violations"] > 1000
    check_samples(flight, samples, 1e-4)
    with pytest.raises(AssertionError, match="mean"):
        check_mean(delta.round.moments, flight.reference(), 1e-4)


@pytest.mark.parametrize("tracker", ["residual_ratio", "weighted_decomposition"])
def test_nothing_collides_with_a_majorant_of_nothing(rig, tracker):
    """Where the control is the extinction nothing is left to collide with.

    With this seed one path in a million met such a cell with a draw that rounding had made
    negative, and became no number.
    """
    octree = {"octree": {"resolution": 8}}
    flight = rig.flight(tracker=tracker, medium="trilinear", majorant=octree, lanes=16, seed=6)
    check_clean(flight.run(4096), bounded=False)
