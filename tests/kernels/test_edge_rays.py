"""Rays where walks break: along faces, edges and corners, at boundaries, short, missing."""

import itertools

import numpy as np
import pytest
from freepath.check.cases import check_samples
from freepath.check.identities import check_clean
from freepath.check.verdict import require, sidak
from scipy import stats

CELLS = 8
RANDOM = np.random.default_rng(4)
# A unit cube; about half of the voxels are empty.
VOXELS = 4.0 * RANDOM.random((CELLS,) * 3) * (RANDOM.random((CELLS,) * 3) > 0.5)

# The grid's faces are also faces of voxels, so that a ray along one has nothing but ties.
MAJORANTS = {"global": "global", "grid": {"grid": {"resolution": 4}}}
TRACKERS = [("regular", "global"), *itertools.product(("delta", "ratio"), MAJORANTS)]
ALPHA = sidak(1e-3, 2 * len(TRACKERS))


def lines_of_all_kinds():
    """Origins and directions, by what is special about them."""
    kinds = {}
    axes = np.vstack([np.eye(3), -np.eye(3)])
    # beside the ray: the middle of a cell, a face, an edge, faces and edges of the box
    places = [(0.3125, 0.6875), (0.25, 0.6875), (0.25, 0.5), (0.0, 0.3), (1.0, 0.3), (0.0, 1.0)]
    along = [(axis, place) for axis in axes for place in places]
    kinds["along an axis"] = (
        [np.insert(place, np.abs(axis).argmax(), 0.5) - 2.0 * axis for axis, place in along],
        [axis for axis, _ in along],
    )
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
    kinds["corner to corner"] = (corners - (1.0 - 2.0 * corners), 1.0 - 2.0 * corners)
    kinds["from a corner"] = (corners, 1.0 - 2.0 * corners)
    kinds["along a face, through its edges"] = (
        [[0.25, -1, -1], [0.5, 2, -1]],
        [[0, 1, 1], [0, -1, 1]],
    )
    kinds["from the boundary"] = ([[0, 0.3, 0.4], [1, 0.3, 0.4]], [[1, 0.2, 0.3], [-1, 0.2, -0.3]])
    kinds["from inside"] = ([[0.25, 0.5, 0.5], [0.3, 0.4, 0.2]], [[1, 0.2, 0.3], [0, 0, -1]])
    kinds["all but parallel"] = (
        [[-1, 0.25, 0.3], [-1, 0.25, 0.3], [-1, 0.5 - 1e-9, 0.3], [-1, 0.26, 0.3]],
        [[1, 1e-7, 0], [1, -1e-38, 0], [1, 1e-9, 1e-9], [1, 1e-310, -1e-300]],
    )
    return kinds


def without_length():
    """Rays that miss, that only touch an edge or a corner, or start where they leave."""
    origins = [[2, 2, 2], [-1, 0.5, 0.5], [-1, 1.5, 0.5], [-1, 1, 0.5], [3, -1, 0.5], [1, 0.5, 0.5]]
    directions = [[1, 0, 0], [-1, 0, 0], [1, 0, 0], [1, -1, 0], [-1, 1, 0], [1, 0.5, 0]]
    origins += [[-1, -1, -1], [3, 0, 0]]
    directions += [[0, 0, 1], [-1, 1, 0]]
    return np.array(origins, float), unit(directions)


def unit(directions):
    directions = np.array(directions, float)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


LINES = {kind: (np.array(a, float), unit(b)) for kind, (a, b) in lines_of_all_kinds().items()}


def check_each_ray(moments, expected):
    """z-tests of single rays: one that goes wrong must not hide among others.

    A ray with hardly a collision has no normal distribution; one event more is let pass.
    """
    one_event = 1.0 / moments.count
    error = np.sqrt(moments.variance / moments.count + one_event**2)
    require(2.0 * stats.norm.sf(np.abs(moments.mean - expected) / error), ALPHA, "mean of a ray")


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
@pytest.mark.parametrize(("tracker", "majorant"), TRACKERS)
def test_special_rays(rig, tracker, majorant, interpolation):
    medium = rig.volume(VOXELS, voxel_size=1 / CELLS, interpolation=interpolation)
    axes = {"tracker": tracker, "majorant": MAJORANTS[majorant], "lanes": 16}
    lines = [np.concatenate(parts) for parts in zip(*LINES.values(), strict=True)]
    flight = rig.flight(**axes, medium=medium, lines=tuple(lines))
    assert (flight.segments[:, 6] > 0.1).all()
    samples = flight.record(8192)
    check_samples(flight, samples, ALPHA)
    check_each_ray(samples.round.moments, flight.reference())

    nothing = rig.flight(**axes, medium=medium, lines=without_length())
    assert (nothing.segments[:, 6] == 0.0).all()
    samples = nothing.record(16)
    check_clean(samples.round, bounded=True)
    assert samples.escaped.all()
    assert (samples.weight == 1.0).all()


@pytest.mark.parametrize("majorant", MAJORANTS)
@pytest.mark.parametrize("tracker", ["delta", "ratio"])
def test_empty_medium(rig, tracker, majorant):
    """A majorant of 0: nothing is looked up, and nothing divided by it."""
    empty = {"homogeneous": {"sigma_t": 0}}
    for medium in (empty, rig.volume(0.0 * VOXELS, voxel_size=1 / CELLS)):
        flight = rig.flight(tracker=tracker, medium=medium, majorant=MAJORANTS[majorant], lanes=16)
        samples = flight.record(64)
        check_clean(samples.round, bounded=True)
        assert samples.round.counters["lookups"] == 0
        assert samples.escaped.all()
        assert (samples.weight == 1.0).all()
        assert (samples.round.moments.mean == 1.0).all()


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
@pytest.mark.parametrize(("tracker", "majorant"), TRACKERS)
def test_one_voxel(rig, tracker, majorant, interpolation):
    voxels = np.zeros((64, 64, 64))
    voxels[40, 20, 30] = 60.0
    medium = rig.volume(voxels, voxel_size=1 / 64, interpolation=interpolation)
    # half of the rays go through the voxel, and half through nothing
    offsets = np.random.default_rng(9).normal(size=(2, 64, 3))
    centre = np.array([30.5, 20.5, 40.5]) / 64
    offsets[1] = np.cross(offsets[0], offsets[1])
    directions = unit(offsets[0])
    origins = np.concatenate(
        [centre - 2.0 * directions, centre - 2.0 * directions + 0.2 * unit(offsets[1])]
    )
    axes = {"tracker": tracker, "majorant": {"grid": {"resolution": 16}}, "lanes": 16}
    axes["majorant"] = "global" if majorant == "global" else axes["majorant"]
    flight = rig.flight(**axes, medium=medium, lines=(origins, np.tile(directions, (2, 1))))
    expected = flight.reference()
    assert (expected[:64] < 0.9).all()
    assert (expected[64:] == 1.0).all()
    samples = flight.record(1024)
    check_samples(flight, samples, ALPHA)
    assert (samples.round.moments.mean[64:] == 1.0).all()


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
@pytest.mark.parametrize(("tracker", "majorant"), TRACKERS)
def test_equal_voxels_are_a_homogeneous_medium(rig, tracker, majorant, interpolation):
    volume = rig.volume(np.full((4, 4, 4), 2.0), voxel_size=0.25, interpolation=interpolation)
    found = []
    for medium in (volume, {"homogeneous": {"sigma_t": 2.0}}):
        axes = {"tracker": tracker, "majorant": MAJORANTS[majorant], "lanes": 16, "tightness": 2}
        flight = rig.flight(**axes, medium=medium, estimand="transmittance")
        found.append(flight.record(512))
    one, other = found
    np.testing.assert_allclose(one.round.moments.mean, other.round.moments.mean, atol=1e-5)
    if tracker != "regular":  # which has other cells
        assert np.count_nonzero(one.lookups != other.lookups) < 1e-5 * one.lookups.size


@pytest.mark.parametrize("unit_length", [1e-6, 1e6])
@pytest.mark.parametrize(("tracker", "majorant"), TRACKERS)
def test_units_do_not_matter(rig, tracker, majorant, unit_length):
    medium = rig.volume(VOXELS, voxel_size=unit_length / CELLS, sigma_t=1 / unit_length)
    lines = LINES["along an axis"][0] * unit_length, LINES["along an axis"][1]
    axes = {"tracker": tracker, "majorant": MAJORANTS[majorant], "lanes": 16}
    flight = rig.flight(**axes, medium=medium, lines=lines)
    samples = flight.record(1024)
    check_samples(flight, samples, ALPHA)
    one = rig.flight(
        **axes, medium=rig.volume(VOXELS, voxel_size=1 / CELLS), lines=LINES["along an axis"]
    )
    np.testing.assert_allclose(flight.reference(), one.reference(), rtol=1e-6)
