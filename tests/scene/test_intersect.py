import numpy as np
import pytest

from freepath.scene import segments
from freepath.scene.media.formulas import Homogeneous
from freepath.scene.media.grid import GridMedium

pytestmark = pytest.mark.filterwarnings("error")

BOX = Homogeneous(1.0, (2.0, 3.0, 4.0))
DENORMAL = 5e-324
ROOT_HALF = np.sqrt(0.5)


def enter(origin, direction, medium=BOX):
    segment = segments(np.array([origin], float), np.array([direction], float), medium)[0]
    assert np.isfinite(segment).all()
    assert np.all((segment[:3] >= 0.0) & (segment[:3] <= medium.extent))
    return segment[:3].tolist(), segment[6]


@pytest.mark.parametrize(
    ("origin", "direction", "point", "length"),
    [
        # along an axis, from outside, either way
        ((-1, 1, 1), (1, 0, 0), (0, 1, 1), 2),
        ((5, 1, 1), (-1, 0, 0), (2, 1, 1), 2),
        ((1, 1, -7), (0, 0, 1), (1, 1, 0), 4),
        ((1, 1, -7), (-0.0, 0.0, 1), (1, 1, 0), 4),
        # from inside
        ((1, 1, 1), (0, 1, 0), (1, 1, 1), 2),
        ((1, 1, 1), (0, -1, 0), (1, 1, 1), 1),
        # from the boundary, inward
        ((0, 1, 1), (1, 0, 0), (0, 1, 1), 2),
        ((2, 1, 1), (-1, 0, 0), (2, 1, 1), 2),
        # along a face and along an edge: inside
        ((0, 1, -1), (0, 0, 1), (0, 1, 0), 4),
        ((2, 3, -1), (0, 0, 1), (2, 3, 0), 4),
        # from corner to corner of a face
        ((-1, -1, 0), (ROOT_HALF, ROOT_HALF, 0), (0, 0, 0), 2 / ROOT_HALF),
        # denormal components
        ((1, 1, -1), (DENORMAL, -DENORMAL, 1), (1, 1, 0), 4),
        ((0, 0, -1), (DENORMAL, DENORMAL, 1), (0, 0, 0), 4),
        ((1, 1, -1), (1e-310, 0, 1), (1, 1, 0), 4),
        # far away
        ((1, 1, -1e6), (0, 0, 1), (1, 1, 0), 4),
    ],
)
def test_hits(origin, direction, point, length):
    found, found_length = enter(origin, direction)
    assert found == pytest.approx(point, abs=1e-300)
    assert found_length == pytest.approx(length, rel=1e-15)


@pytest.mark.parametrize(
    ("origin", "direction"),
    [
        ((-1, 5, 1), (1, 0, 0)),  # beside
        ((5, 1, 1), (1, 0, 0)),  # away
        ((2, 1, 1), (1, 0, 0)),  # from the boundary, outward
        ((-1, 1, 0), (-ROOT_HALF, ROOT_HALF, 0)),
        ((-1, 0, 2), (ROOT_HALF, -ROOT_HALF, 0)),
        ((-1, 1, 2), (ROOT_HALF, -ROOT_HALF, 0)),  # touches an edge
        ((-1, 1 - 1e-12, 2), (ROOT_HALF, -ROOT_HALF, 0)),  # just misses it
        ((-1, 3.0000001, 1), (1, 0, 0)),
        ((-1, 5, 1), (1, DENORMAL, 0)),
        ((-1, 5, 1), (1, -DENORMAL, 0)),
        ((-DENORMAL, 1, 1), (0, 0, 1)),
        ((1e6, 1e6, 1e6), (0, 0, 1)),
    ],
)
def test_misses(origin, direction):
    assert enter(origin, direction)[1] == 0.0


def test_points_of_entry_lie_on_the_faces_exactly():
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    inside = rng.random((500, 3)) * BOX.extent
    found = segments(inside - 1e4 * directions, directions, BOX)
    assert np.all(found[:, 6] > 0.0)
    on_face = (found[:, :3] == 0.0) | (found[:, :3] == BOX.extent)
    assert np.all(on_face.any(axis=1))
    left = found[:, :3] + found[:, 6, None] * found[:, 3:6]
    distance = np.minimum(np.abs(left), np.abs(left - BOX.extent)).min(axis=1)
    assert np.all(distance < 1e-11)


def test_a_turned_and_scaled_grid():
    # world = R diag(1, 2, 4) voxels + t, R a quarter turn about z: x -> y, y -> -x
    to_world = np.array([[0.0, -2.0, 0.0, 10.0], [1.0, 0.0, 0.0, 20.0], [0.0, 0.0, 4.0, 30.0]])
    inverse = np.linalg.inv(to_world[:, :3])
    to_medium = np.column_stack([inverse, -inverse @ to_world[:, 3]])
    medium = GridMedium(np.ones((2, 3, 5), np.float32), to_medium, "nearest")
    corners = medium.world_box()
    assert corners.min(axis=0) == pytest.approx([10 - 6, 20, 30])
    assert corners.max(axis=0) == pytest.approx([10, 20 + 5, 30 + 8])
    # down the world's x the voxels' y rises by half a voxel per unit
    segment = segments(np.array([[12.0, 22.5, 32.0]]), np.array([[-1.0, 0.0, 0.0]]), medium)[0]
    assert segment.tolist() == pytest.approx([2.5, 0.0, 0.5, 0.0, 0.5, 0.0, 6.0])
    assert medium.optical_depth(segment[None])[0] == pytest.approx(6.0)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_scale_of_the_world_does_not_matter(scale):
    medium = Homogeneous(1.0 / scale, tuple(scale * BOX.extent))
    direction = np.array([[0.36, 0.48, 0.8]])
    origin = np.array([[1.0, 1.0, 1.0]]) - 3.0 * direction
    length = segments(scale * origin, direction, medium)[0, 6]
    assert length == pytest.approx(segments(origin, direction, BOX)[0, 6] * scale, rel=1e-14)
