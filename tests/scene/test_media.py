import numpy as np
import pytest

from freepath.scene.media.base import Medium
from freepath.scene.media.closed_form import ClosedForm
from freepath.scene.media.formulas import Cosine, Exponential, Homogeneous, Layered, Linear
from freepath.scene.media.gaussian import Gaussian
from scene.helpers import CLOSED_FORMS, MEDIA, SIZE, borders_of, cut, integrate, segments_in

pytestmark = pytest.mark.filterwarnings("error")

closed_forms = pytest.mark.parametrize("medium", CLOSED_FORMS.values(), ids=CLOSED_FORMS)
all_media = pytest.mark.parametrize("medium", MEDIA.values(), ids=MEDIA)

UPRIGHT = np.array([[0.5, 0.5, 0.0, 0.0, 0.0, 1.0, SIZE[2]]])


@all_media
def test_optical_depth_is_the_integral_of_sigma_t(medium):
    segments = segments_in(medium.extent)
    depths = medium.optical_depth(segments)
    for segment, depth in zip(segments, depths, strict=True):

        def sigma_t(t, segment=segment):
            return medium.sigma_t((segment[:3] + t * segment[3:6])[None])[0]

        expected = integrate(sigma_t, borders_of(medium, segment))
        assert depth == pytest.approx(expected, rel=1e-11, abs=1e-250)


@all_media
def test_distance_is_the_inverse_of_optical_depth(medium):
    segments = np.repeat(segments_in(medium.extent), 20, axis=0)
    total = medium.optical_depth(segments)
    depth = np.random.default_rng(8).random(len(segments)) ** 4 * total
    length = medium.distance(segments, depth)
    hit = total > 0.0
    assert np.all(np.isinf(length[~hit]))
    assert np.all(length[hit] <= segments[hit, 6] * (1.0 + 1e-12))
    reached = medium.optical_depth(cut(segments, np.where(hit, length, 0.0)))
    # a length of float64 cannot say more about a depth than its last digit times sigma_t
    digit = 4e-16 * medium.bounds((1, 1, 1))[1].item() * segments[:, 6].max()
    np.testing.assert_allclose(reached[hit], depth[hit], rtol=1e-11, atol=digit)


@all_media
def test_what_the_segment_does_not_hold_escapes(medium):
    segments = segments_in(medium.extent)
    total = medium.optical_depth(segments)
    for depth in (total, total * 1.5 + 1.0):
        assert np.all(np.isinf(medium.distance(segments, depth)))


@closed_forms
def test_the_inverse_in_closed_form_agrees_with_the_search(medium):
    segments = segments_in(SIZE)
    depth = medium.optical_depth(segments) * 0.37
    for own, general in zip(
        medium.distance(segments, depth), Medium.distance(medium, segments, depth), strict=True
    ):
        assert own == pytest.approx(general, rel=1e-11)


@all_media
def test_pieces_add_up_to_the_segment(medium):
    segments = segments_in(medium.extent)
    pieces = medium.pieces(segments)
    assert pieces.start.shape == (len(segments), medium.pieces_per_segment)
    np.testing.assert_allclose(pieces.length.sum(axis=1), segments[:, 6], rtol=1e-13)
    np.testing.assert_allclose(
        pieces.depth.sum(axis=1), medium.optical_depth(segments), rtol=1e-11, atol=1e-250
    )


@all_media
def test_chunks_do_not_change_the_depth(medium, monkeypatch):
    segments = segments_in(medium.extent)
    whole = medium.optical_depth(segments)
    monkeypatch.setattr("freepath.scene.media.base.CELLS_PER_CHUNK", 1)
    np.testing.assert_array_equal(medium.optical_depth(segments), whole)


@closed_forms
@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 3, 5), (1, 4, 64)])
def test_bounds_contain_all_points_and_touch_some(medium, cells):
    minorant, majorant = medium.bounds(cells)
    assert minorant.shape == majorant.shape == cells[::-1]
    grid = [np.linspace(0.0, 1.0, 9 if n < 64 else 33) for n in cells]
    local = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 3)
    scale = majorant.max() or 1.0
    for z, y, x in np.ndindex(minorant.shape):
        points = (local + (x, y, z)) / cells * SIZE
        # a layer's top belongs to the layer above it
        points[:, 2] = np.minimum(points[:, 2], (z + 1) / cells[2] * SIZE[2] * (1.0 - 1e-9))
        values = medium.sigma_t(points)
        assert values.min() >= minorant[z, y, x] - 1e-12 * scale
        assert values.max() <= majorant[z, y, x] + 1e-12 * scale


@closed_forms
def test_bounds_are_reached(medium):
    # exact to what a dense sampling can tell: so fine that neighbours hardly differ
    cells = (1, 1, 5)
    minorant, majorant = medium.bounds(cells)
    heights = np.linspace(0.0, SIZE[2], 200_001)[:-1]
    column = np.broadcast_to(getattr(medium, "_center", np.zeros(3)), (len(heights), 3)).copy()
    column[:, 2] = heights
    rows = (heights * 5 / SIZE[2]).astype(int)
    values = medium.sigma_t(column)
    for row in range(5):
        assert values[rows == row].max() == pytest.approx(majorant[row, 0, 0], rel=5e-3, abs=1e-9)
    if not isinstance(medium, Gaussian):
        for row in range(5):
            lowest = values[rows == row].min()
            assert lowest == pytest.approx(minorant[row, 0, 0], rel=1e-2, abs=1e-4)


def test_the_minorant_of_a_blob_is_at_the_farthest_corner():
    medium = Gaussian(7.0, 0.9, (0.1, 0.2, 0.3), SIZE)
    assert medium.bounds((1, 1, 1))[0][0, 0, 0] == pytest.approx(medium.sigma_t([SIZE])[0])


@closed_forms
def test_mean_over_the_box(medium):
    nodes, weights = np.polynomial.legendre.leggauss(10)
    x = ((np.arange(100)[:, None] + (nodes + 1.0) / 2.0) / 100).ravel()
    weight = np.tile(weights / 200.0, 100)
    center = getattr(medium, "_center", np.full(3, 0.5))
    product = 1.0
    for axis in range(3):
        points = np.tile(center, (len(x), 1))
        points[:, axis] = x * SIZE[axis]
        product *= weight @ medium.sigma_t(points)
    peak = medium.sigma_t(center[None])[0]
    if isinstance(medium, Layered):
        expected = (0.0 * 0.3 + 3.0 * 0.7 + 1.0 * 1.5 + 0.2 * 0.5) / 3.0
    elif isinstance(medium, Gaussian):
        expected = product / peak**2  # it is a product over the axes
    else:
        expected = product / peak**2 if peak else 0.0
    assert medium.mean() == pytest.approx(expected, rel=1e-9)


def test_numbers_and_data_are_what_the_kernels_expect():
    size = (1.0, 1.0, 4.0)
    layered = Layered((1.0, 2.5), (0.5, 2.0, 1.0), size)
    expected = {
        Homogeneous(2.0, size): {"sigma_t": 2.0},
        Linear(1.0, 3.0, size): {"bottom": 1.0, "slope": 0.5},
        Exponential(2.0, 0.5, size): {"sigma_t": 2.0, "inverse_height": 2.0},
        Cosine(2.0, 0.5, 2.0, 0.1, size): {
            "mean": 2.0,
            "amplitude": 0.5,
            "wavenumber": np.pi,
            "phase": 0.1,
        },
        layered: {"layers": 3.0},
        Gaussian(3.0, 0.5, None, size): {
            "peak": 3.0,
            "inverse_width": 2.0,
            "center_x": 0.5,
            "center_y": 0.5,
            "center_z": 2.0,
        },
    }
    for medium, numbers in expected.items():
        assert list(medium.numbers.items()) == list(numbers.items())
        assert medium.offers >= {"closed_form"}
    assert layered.data.dtype == np.float32
    assert layered.data.tolist() == [0.5, 2.0, 1.0, 0.0, 1.0, 2.5, 4.0]
    cells = {medium.kernel for medium in expected if "cells" in medium.offers}
    assert cells == {"homogeneous", "layered"}


def test_a_depth_of_zero_skips_the_vacuum_before_the_medium():
    medium = Layered((1.0,), (0.0, 2.0), SIZE)
    assert medium.distance(UPRIGHT, np.zeros(1))[0] == 1.0
    assert np.isinf(Homogeneous(0.0, SIZE).distance(UPRIGHT, np.zeros(1))[0])
    assert Homogeneous(1.0, SIZE).distance(UPRIGHT, np.zeros(1))[0] == 0.0


def test_a_boundary_belongs_to_the_layer_above():
    medium = Layered((1.0,), (1.0, 2.0), SIZE)
    along = np.array([[0.0, 0.5, 1.0, 1.0, 0.0, 0.0, 1.5]])
    assert medium.optical_depth(along)[0] == pytest.approx(3.0)
    assert medium.sigma_t(np.array([[0.5, 0.5, 1.0]]))[0] == 2.0


def test_cells_that_end_at_a_layer_do_not_see_the_next():
    minorant, majorant = Layered((0.3, 0.6), (1.0, 5.0, 2.0), (1.0, 1.0, 1.0)).bounds((1, 1, 10))
    assert majorant.ravel().tolist() == [1.0] * 3 + [5.0] * 3 + [2.0] * 4
    assert minorant.ravel().tolist() == majorant.ravel().tolist()


@pytest.mark.parametrize("direction", [1e-18, -1e-18, 5e-324, 1e-310])
@closed_forms
def test_almost_level_rays_agree_with_level_ones(medium, direction):
    level = np.array([[0.1, 1.0, 1.3, 1.0, 0.0, 0.0, 1.2]])
    almost = level.copy()
    almost[0, 5] = direction
    depth = medium.optical_depth(level)
    assert medium.optical_depth(almost)[0] == pytest.approx(depth[0], rel=1e-12)
    if depth[0] > 0.0:
        ends = medium.distance(level, depth / 3.0), medium.distance(almost, depth / 3.0)
        assert ends[0][0] == pytest.approx(ends[1][0], rel=1e-12)


def test_an_atmosphere_keeps_its_digits_where_it_is_thin():
    # 500 scale heights up sigma_t is 1e-217, and the ray ends where it is dense
    medium = Exponential(5.0, 1e-3, (1.0, 1.0, 1.0))
    down = np.array([[0.5, 0.5, 0.5, 0.0, 0.0, -1.0, 0.5]])
    assert medium.optical_depth(down)[0] == pytest.approx(5e-3, rel=1e-12)
    assert medium.distance(down, np.array([2.5e-3]))[0] == pytest.approx(0.5 - 1e-3 * np.log(2.0))
    # so far up that it underflows
    medium = Exponential(5.0, 1e-4, (1.0, 1.0, 1.0))
    assert medium.distance(down, np.array([2.5e-4]))[0] == pytest.approx(0.5 - 1e-4 * np.log(2.0))
    thin = Exponential(1e-12, 1e6, SIZE).optical_depth(UPRIGHT)
    assert thin[0] == pytest.approx(3e-12 * (1.0 - 1.5e-6), rel=1e-11, abs=0.0)


def test_waves_keep_their_digits_at_their_zeros():
    medium = Cosine(1.0, 1.0, 1.0, 0.0, (1.0, 1.0, 1.0))  # zero at z = 1/2, there 2 pi^2 dz^2
    step = 1e-6
    across = np.array([[0.5, 0.5, 0.5 - step, 0.0, 0.0, 1.0, 2.0 * step]])
    expected = 2.0 * np.pi**2 * 2.0 * step**3 / 3.0
    assert medium.optical_depth(across)[0] == pytest.approx(expected, rel=1e-9, abs=0.0)


def test_fingerprints_tell_media_apart():
    media = [
        Homogeneous(1.0, SIZE),
        Homogeneous(2.0, SIZE),
        Homogeneous(1.0, (1.5, 2.0, 4.0)),
        Linear(1.0, 1.0, SIZE),
        Layered((1.0,), (1.0, 2.0), SIZE),
        Layered((1.0 + 1e-12,), (1.0, 2.0), SIZE),
        Layered((1.0,), (1.0, 2.0 + 1e-12), SIZE),
    ]
    assert len({medium.fingerprint for medium in media}) == len(media)
    assert Homogeneous(1.0, SIZE).fingerprint == media[0].fingerprint


def test_the_world_box_of_a_closed_form_is_its_own():
    corners = Homogeneous(1.0, SIZE).world_box()
    assert corners.tolist()[0] == [0.0, 0.0, 0.0]
    assert corners.tolist()[1] == [1.5, 0.0, 0.0]
    assert corners.tolist()[-1] == list(SIZE)
    assert isinstance(CLOSED_FORMS["blob"], ClosedForm)
