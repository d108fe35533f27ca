import numpy as np
import pytest

from freepath.scene.media.formulas import Homogeneous
from freepath.scene.media.grid import GridMedium
from scene.helpers import segments_in, voxels

pytestmark = pytest.mark.filterwarnings("error")

INTERPOLATIONS = ("trilinear", "nearest")
both = pytest.mark.parametrize("interpolation", INTERPOLATIONS)


def grid(densities, interpolation="trilinear"):
    return GridMedium(np.asarray(densities, dtype=np.float32), np.eye(3, 4), interpolation)


def test_values_hold_at_voxel_centres_and_are_clamped_beyond_them():
    medium = grid([[[1.0, 3.0, 7.0]] * 2] * 2)
    points = [(x, 1, 1) for x in (0.5, 1.5, 1.0, 1.75, 2.75)] + [(0, 0, 0), (3, 2, 2)]
    assert medium.sigma_t(np.array(points)).tolist() == [1.0, 3.0, 2.0, 4.0, 7.0, 1.0, 7.0]
    nearest = grid([[[1.0, 3.0, 7.0]]], "nearest")
    points = [(0.0, 0, 0), (0.99, 1, 1), (1.0, 0, 0), (2.9, 0, 0), (3.0, 1, 1)]
    assert nearest.sigma_t(np.array(points)).tolist() == [1.0, 1.0, 3.0, 7.0, 7.0]


@both
def test_axes_are_x_y_z_and_data_is_z_y_x(interpolation):
    densities = voxels((2, 3, 4))
    medium = grid(densities, interpolation)
    assert medium.kernel == f"grid_{interpolation}"
    assert medium.offers == {"cells"}
    assert list(medium.numbers.items()) == [("nx", 4.0), ("ny", 3.0), ("nz", 2.0)]
    assert medium.extent.tolist() == [4.0, 3.0, 2.0]
    assert medium.data.dtype == np.float32
    assert medium.data.tolist() == densities.ravel().tolist()
    for z, y, x in np.ndindex(densities.shape):
        centre = np.array([[x + 0.5, y + 0.5, z + 0.5]])
        assert medium.sigma_t(centre)[0] == densities[z, y, x]


def test_an_axis_of_one_voxel_becomes_two_halves():
    medium = GridMedium(voxels((1, 3, 1)) + 1, np.eye(3, 4), "trilinear")
    assert medium.extent.tolist() == [2.0, 3.0, 2.0]
    assert medium.data.reshape(2, 3, 2)[0, :, 0].tolist() == medium.voxels[1, :, 1].tolist()
    assert np.allclose(medium.world_box()[-1], [1.0, 3.0, 1.0])
    assert GridMedium(voxels((1, 3, 1)), np.eye(3, 4), "nearest").extent.tolist() == [1, 3, 1]


@both
def test_equal_voxels_are_a_homogeneous_medium(interpolation):
    medium = grid(np.full((4, 5, 6), 0.75), interpolation)
    segments = segments_in(medium.extent)
    expected = Homogeneous(0.75, (6.0, 5.0, 4.0)).optical_depth(segments)
    np.testing.assert_allclose(medium.optical_depth(segments), expected, rtol=1e-14)


@both
def test_rays_along_faces_edges_and_corners_of_voxels(interpolation):
    densities = voxels((4, 4, 4)) + np.float32(0.1)
    medium = grid(densities, interpolation)
    axis = [1.0, 0.0, 0.0]
    root = np.sqrt(3.0)
    rays = np.array(
        [
            [0, 2, 2, *axis, 4],  # an edge between four voxels
            [0, 2, 1.5, *axis, 4],  # a face
            [0, 1.5, 1.5, *axis, 4],  # the centres
            [0, 0, 0, *axis, 4],  # an edge of the box
            [0, 4, 4, *axis, 4],
            [0, 0, 0, *np.full(3, 1 / root), 4 * root],  # through the corners of voxels
        ]
    )
    depth = medium.optical_depth(rays)
    for ray, found in zip(rays, depth, strict=True):
        t = (np.arange(400_000) + 0.5) / 400_000 * ray[6]
        values = medium.sigma_t(ray[:3] + t[:, None] * ray[3:6])
        assert found == pytest.approx(values.mean() * ray[6], rel=1e-5)


def test_a_small_value_beside_a_large_one_keeps_its_digits():
    medium = grid([[[0.0, 1e6]] * 2] * 2)
    beside = 2.0**-40
    segment = np.array([[0.5 + beside, 0.6, 0.0, 0.0, 0.0, 1.0, 2.0]])
    assert medium.optical_depth(segment)[0] == pytest.approx(2e6 * beside, rel=1e-15)
    contrast = grid([[[0.0, 1e6, 0.0, 1e-38]] * 2] * 2, "nearest")
    across = np.array([[3.0, 0.5, 0.5, 1.0, 0.0, 0.0, 1.0]])
    assert contrast.optical_depth(across)[0] == np.float32(1e-38)


def test_optical_depth_counts_world_lengths():
    # voxels of half a unit: a segment of world length 2 crosses four of them
    medium = GridMedium(np.full((4, 4, 4), 3.0, np.float32), 2.0 * np.eye(3, 4), "nearest")
    segment = np.array([[0.0, 0.5, 0.5, 2.0, 0.0, 0.0, 2.0]])
    assert medium.optical_depth(segment)[0] == pytest.approx(6.0)
    assert medium.distance(segment, np.array([1.5]))[0] == pytest.approx(0.5)


@both
@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 3, 4), (7, 5, 3), (12, 11, 10)])
def test_bounds_are_the_extremes_of_the_voxels_that_a_cell_can_touch(interpolation, cells):
    densities = voxels((5, 6, 7))
    minorant, majorant = grid(densities, interpolation).bounds(cells)
    halo = 0.5 if interpolation == "trilinear" else 0.0
    assert minorant.shape == majorant.shape == cells[::-1]
    assert majorant.dtype == np.float64
    for z, y, x in np.ndindex(majorant.shape):
        touched = []
        for i, count, size in zip((z, y, x), cells[::-1], densities.shape, strict=True):
            # of voxel v the support is the open interval (v - halo, v + 1 + halo)
            v = np.arange(size)
            low, high = i * size / count, (i + 1) * size / count
            eps = 1e-9
            overlaps = (v - halo < high - eps) & (v + 1 + halo > low + eps)
            if not overlaps.any():
                overlaps = v == np.clip(int(low), 0, size - 1)
            touched.append(np.flatnonzero(overlaps))
        values = densities[np.ix_(*touched)]
        assert minorant[z, y, x] == values.min()
        assert majorant[z, y, x] == values.max()


@both
@pytest.mark.parametrize("cells", [(3, 4, 5), (5, 3, 2)])
def test_bounds_contain_all_points_of_the_closed_cells(interpolation, cells):
    medium = grid(voxels((5, 6, 7)), interpolation)
    minorant, majorant = medium.bounds(cells)
    rng = np.random.default_rng(1)
    local = np.concatenate([rng.random((400, 3)), np.indices((2, 2, 2)).reshape(3, -1).T])
    if interpolation == "nearest":
        local *= 1.0 - 1e-9  # a face belongs to the next voxel
    for z, y, x in np.ndindex(majorant.shape):
        values = medium.sigma_t((local + (x, y, z)) / cells * medium.extent)
        assert values.min() >= minorant[z, y, x] * (1.0 - 1e-15)
        assert values.max() <= majorant[z, y, x] * (1.0 + 1e-15)


@both
def test_one_voxel_fills_exactly_its_own_cells_and_its_neighbours(interpolation):
    halo = interpolation == "trilinear"
    for place, cells in [(7, {0, 1} if halo else {0}), (8, {0, 1} if halo else {1}), (12, {1})]:
        densities = np.zeros((32, 32, 32))
        densities[place, 12, 12] = 5.0
        minorant, majorant = grid(densities, interpolation).bounds((4, 4, 4))
        found = np.argwhere(majorant > 0.0)
        assert {tuple(cell) for cell in found} == {(z, 1, 1) for z in cells}
        assert majorant.max() == 5.0
        assert not minorant.any()


@both
def test_mean_is_the_integral_over_the_box(interpolation):
    medium = grid(voxels((2, 3, 4)), interpolation)
    # the midpoint rule is exact where a dual cell holds whole cells of the rule
    n = 8
    axes = [(np.arange(extent * n) + 0.5) / n for extent in medium.extent]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    assert medium.mean() == pytest.approx(medium.sigma_t(points).mean(), rel=1e-14)


def test_fingerprints_tell_grids_apart():
    densities = voxels((2, 3, 4))
    other = densities.copy()
    other[1, 2, 3] = np.nextafter(other[1, 2, 3], np.float32(2.0))
    moved = np.eye(3, 4)
    moved[0, 3] = 1e-9
    media = [
        grid(densities),
        grid(densities, "nearest"),
        grid(other),
        grid(densities.reshape(3, 2, 4)),
        GridMedium(densities, moved, "trilinear"),
    ]
    assert len({medium.fingerprint for medium in media}) == len(media)
    assert grid(densities.copy()).fingerprint == media[0].fingerprint
