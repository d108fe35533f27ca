import numpy as np
import pytest
from scipy.special import erfc, exp1

from freepath.scene import reference, references
from freepath.scene.media.formulas import Exponential, Homogeneous, Layered, Linear
from freepath.scene.media.grid import GridMedium
from scene.helpers import MEDIA, SIZE, borders_of, cut, integrate, segments_in, voxels

pytestmark = pytest.mark.filterwarnings("error")

all_media = pytest.mark.parametrize("medium", MEDIA.values(), ids=MEDIA)

UPRIGHT = np.array([[0.5, 0.5, 0.0, 0.0, 0.0, 1.0, SIZE[2]]])


@all_media
def test_free_path_is_the_integral_of_the_transmittance(medium):
    segments = segments_in(medium.extent, 9)[2:]
    for segment, found in zip(segments, references.free_path(medium, segments), strict=True):

        def transmittance(t, segment=segment):
            return np.exp(-medium.optical_depth(cut(segment[None], t))[0])

        # cut at depths too, so that the adaptive rule sees where the transmittance falls
        depths = np.linspace(0.0, 40.0, 41)
        lengths = medium.distance(np.repeat(segment[None], len(depths), axis=0), depths)
        borders = np.concatenate([borders_of(medium, segment), lengths[np.isfinite(lengths)]])
        expected = integrate(transmittance, np.minimum(borders, segment[6]))
        assert found == pytest.approx(expected, rel=1e-11)


@all_media
def test_halving_the_pieces_once_more_changes_nothing(medium):
    segments = segments_in(medium.extent)
    pieces = medium.pieces(segments)
    coarse, fine = references._free_path(pieces), references._free_path(pieces, thickest=0.5)
    np.testing.assert_allclose(coarse, fine, rtol=1e-13)


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1.0, 30.0, 1e6, 1e15])
def test_free_path_closed_forms(scale):
    length = SIZE[2]
    homogeneous = references.free_path(Homogeneous(scale, SIZE), UPRIGHT)[0]
    assert homogeneous == pytest.approx(-np.expm1(-scale * length) / scale, rel=1e-13)
    # integral of exp(-b t^2 / 2)
    rising = references.free_path(Linear(0.0, scale, SIZE), UPRIGHT)[0]
    root = np.sqrt(scale / length / 2.0)
    expected = np.sqrt(np.pi) / (2.0 * root) * (1.0 - erfc(root * length))
    assert rising == pytest.approx(expected, rel=1e-9 if scale < 1e-9 else 1e-13)


def test_free_path_in_an_atmosphere():
    # with v = tau exp(-z / H) the integral is H exp(-tau) (Ei(tau) - Ei(tau exp(-L / H)));
    # downward it is H exp(v0) (E1(v0) - E1(v1))
    medium = Exponential(5.0, 0.3, SIZE)
    down = np.array([[0.5, 0.5, 3.0, 0.0, 0.0, -1.0, 3.0]])
    low, high = 1.5 * np.exp(-10.0), 1.5
    expected = 0.3 * np.exp(low) * (exp1(low) - exp1(high))
    assert references.free_path(medium, down)[0] == pytest.approx(expected, rel=1e-13)


def test_free_path_of_layers_by_hand():
    medium = Layered((1.0, 2.0), (0.0, 2.0, 0.0), SIZE)
    expected = 1.0 + (1.0 - np.exp(-2.0)) / 2.0 + np.exp(-2.0)
    assert references.free_path(medium, UPRIGHT)[0] == pytest.approx(expected, rel=1e-14)


def test_what_misses_has_no_free_path_and_is_transparent():
    segments = cut(UPRIGHT, 0.0)
    for medium in MEDIA.values():
        assert references.free_path(medium, segments)[0] == 0.0
        assert references.transmittance(medium, segments)[0] == 1.0


@all_media
def test_estimands(medium):
    segments = segments_in(medium.extent)
    depth = medium.optical_depth(segments)
    np.testing.assert_array_equal(reference("transmittance", medium, segments), np.exp(-depth))
    mean = reference("mean_extinction", medium, segments)
    assert mean.tolist() == [medium.mean()] * len(segments)
    expected = references.free_path(medium, segments)
    np.testing.assert_array_equal(reference("free_path", medium, segments), expected)


def test_a_thick_medium_has_a_transmittance_of_zero():
    assert reference("transmittance", Homogeneous(1e6, SIZE), UPRIGHT)[0] == 0.0
    dense = GridMedium(voxels((4, 4, 4), 1e6), np.eye(3, 4), "trilinear")
    found = reference("free_path", dense, segments_in(dense.extent))
    assert np.all(np.isfinite(found) & (found > 0.0))


def test_references_are_kept_by_medium_segments_and_estimand(monkeypatch):
    medium, segments = MEDIA["trilinear"], segments_in(MEDIA["trilinear"].extent)
    first = reference("free_path", medium, segments)
    calls = []
    computed = references.free_path
    monkeypatch.setattr(references, "free_path", lambda *args: calls.append(1) or computed(*args))
    np.testing.assert_array_equal(reference("free_path", medium, segments), first)
    assert not calls
    for other_medium, other_segments in [
        (MEDIA["nearest"], segments),
        (medium, cut(segments, segments[:, 6] / 2.0)),
    ]:
        reference("free_path", other_medium, other_segments)
    assert len(calls) == 2
    assert not np.array_equal(reference("transmittance", medium, segments), first)
