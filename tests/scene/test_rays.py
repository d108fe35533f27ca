from types import SimpleNamespace

import numpy as np
import pytest

from freepath.errors import FreepathError, VolumeError
from freepath.scene import make_rays, segments
from freepath.scene.media.formulas import Homogeneous
from freepath.scene.media.grid import GridMedium
from freepath.scene.ray_files import COLUMNS

pytestmark = pytest.mark.filterwarnings("error")

BOX = Homogeneous(1.0, (2.0, 3.0, 4.0))


def rays(kind, medium=BOX, seed=1, search_path=(), **parameters):
    model = SimpleNamespace(kind=kind, **parameters)
    origins, directions = make_rays(model, medium, seed, search_path)
    assert origins.shape == directions.shape
    assert origins.dtype == directions.dtype == np.float64
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-15)
    return origins, directions


def test_orthographic_rays_fill_the_boxs_outline():
    origins, directions = rays("orthographic", resolution=(4, 6), direction=(0.0, 0.0, 2.0))
    assert np.all(directions == (0.0, 0.0, 1.0))
    assert np.all(origins[:, 2] < 0.0)
    columns = origins[:, :2].reshape(6, 4, 2)
    # y falls from row to row; looking along z with y up, x is to the left
    assert columns[0, :, 0] == pytest.approx([1.75, 1.25, 0.75, 0.25])
    assert columns[:, 0, 1] == pytest.approx([2.75, 2.25, 1.75, 1.25, 0.75, 0.25])
    assert np.all(segments(origins, directions, BOX)[:, 6] == 4.0)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, -1, 0), (0, 0, -1), (1, 2, -0.5)])
def test_orthographic_rays_frame_the_box_from_anywhere(direction):
    origins, directions = rays("orthographic", resolution=(50, 40), direction=direction)
    forward = directions[0]
    corners = BOX.world_box()
    assert np.all(origins @ forward < (corners @ forward).min())
    hit = segments(origins, directions, BOX)[:, 6] > 0.0
    aligned = np.count_nonzero(direction) == 1
    assert hit.all() if aligned else 0.4 < hit.mean() < 1.0
    if not aligned:  # z is up in the image
        first, last = origins[0], origins[-1]
        assert first[2] > last[2]


def test_orthographic_rays_see_the_whole_of_a_turned_box():
    turn = np.array([[0.8, 0.6, 0.0, 0.0], [-0.6, 0.8, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    medium = GridMedium(np.ones((4, 4, 4), np.float32), turn, "nearest")
    origins, directions = rays("orthographic", medium, resolution=(300, 300), direction=(1, 0, 0))
    length = segments(origins, directions, medium)[:, 6].reshape(300, 300)
    spread = np.ptp(origins, axis=0) * 300 / 299
    # the volume seen by the parallel rays is the box's
    assert length.mean() * spread[1] * spread[2] == pytest.approx(64.0, rel=1e-3)
    assert (length[:, 0] > 0.0).any()
    assert (length[:, -1] > 0.0).any()


def test_perspective_rays():
    origins, directions = rays(
        "perspective",
        resolution=(3, 5),
        position=(-10.0, 1.0, 2.0),
        look_at=(0.0, 1.0, 2.0),
        field_of_view=90.0,
    )
    assert np.all(origins == (-10.0, 1.0, 2.0))
    image = directions.reshape(5, 3, 3)
    assert image[2, 1].tolist() == [1.0, 0.0, 0.0]
    # the top row's centre is at 4/5 of the half height tan(45 degrees), z is up
    assert image[0, 1, 2] / image[0, 1, 0] == pytest.approx(0.8)
    # the left column is at 2/3 of the half width 3/5; looking along x, y is to the left
    assert image[2, 0, 1] / image[2, 0, 0] == pytest.approx(0.6 * 2 / 3)


def test_a_camera_that_looks_at_itself_is_refused():
    with pytest.raises(FreepathError, match="perspective: a direction"):
        rays(
            "perspective",
            resolution=(2, 2),
            position=(1.0, 1.0, 1.0),
            look_at=(1.0, 1.0, 1.0),
            field_of_view=45.0,
        )


CHORDS = 40_000


@pytest.fixture(
    params=[
        np.eye(3, 4),
        np.array([[0.0, 3.0, 0.0, 5.0], [0.5, 0.0, 0.0, 6.0], [0.0, 0.0, 1.0, 7.0]]),
        np.array([[1.0, 0.4, 0.0, 0.0], [0.0, 0.7, 0.1, 0.0], [0.2, 0.0, 1.3, 9.0]]),
    ],
    ids=["cuboid", "mirrored", "sheared"],
)
def chord_box(request):
    return GridMedium(np.ones((2, 3, 4), np.float32), request.param, "nearest")


def test_chords_have_the_mean_length_of_isotropic_flow(chord_box):
    origins, directions = rays("chords", chord_box, count=CHORDS)
    length = segments(origins, directions, chord_box)[:, 6]
    edges = chord_box.world_box()[[1, 2, 4]] - chord_box.world_box()[0]
    volume = abs(np.linalg.det(edges))
    surface = 2.0 * sum(np.linalg.norm(np.cross(edges[i], edges[i - 1])) for i in range(3))
    error = length.std() / np.sqrt(CHORDS)
    assert abs(length.mean() - 4.0 * volume / surface) < 4.0 * error
    # what a flow spends in the box is spread evenly over it
    rest = np.random.default_rng(2).random(CHORDS) * length
    points = origins + rest[:, None] * directions
    local = (points @ chord_box.to_medium[:, :3].T + chord_box.to_medium[:, 3]) / chord_box.extent
    weights = length / length.mean()
    for axis in range(3):
        for low in (0.0, 0.25, 0.5, 0.75):
            inside = weights * ((local[:, axis] >= low) & (local[:, axis] < low + 0.25))
            assert abs(inside.mean() - 0.25) < 4.5 * inside.std() / np.sqrt(CHORDS)


def test_chords_start_on_the_surface_and_go_inward(chord_box):
    origins, directions = rays("chords", chord_box, count=1000)
    local = origins @ chord_box.to_medium[:, :3].T + chord_box.to_medium[:, 3]
    distance = np.minimum(np.abs(local), np.abs(local - chord_box.extent))
    assert np.all(distance.min(axis=1) < 1e-12)
    assert np.mean(segments(origins, directions, chord_box)[:, 6] > 0.0) > 0.999


def test_chords_follow_from_the_seed_alone():
    first = rays("chords", count=100)
    assert np.array_equal(first, rays("chords", count=100))
    assert not np.array_equal(first, rays("chords", count=100, seed=2))
    # the same numbers with any version of numpy
    assert first[0][0] == pytest.approx([2.0, 1.8356879, 2.0305306], abs=1e-6)


def test_a_single_ray():
    origins, directions = rays("single", origin=(1, 2, 3), direction=(0, 0, -5))
    assert origins.tolist() == [[1.0, 2.0, 3.0]]
    assert directions.tolist() == [[0.0, 0.0, -1.0]]


@pytest.mark.parametrize("length", [5e-324, 1e-310, 1e-160, 1e300])
def test_directions_of_any_length_are_normalised(length):
    _, directions = rays("single", origin=(0, 0, 0), direction=(0, length, length))
    assert directions[0] == pytest.approx([0.0, np.sqrt(0.5), np.sqrt(0.5)], rel=1e-15)


@pytest.mark.parametrize("direction", [(0.0, 0.0, 0.0), (np.nan, 0.0, 1.0), (np.inf, 0.0, 0.0)])
def test_pointless_directions_are_refused(direction):
    with pytest.raises(FreepathError, match="single: a direction must be finite and longer than 0"):
        rays("single", origin=(0, 0, 0), direction=direction)


ROWS = [[0, 0, -1, 0, 0, 2], [1, 1, -1, 0, 3, 4]]


def test_rays_from_npy_and_csv_are_the_same(tmp_path):
    np.save(tmp_path / "rays.npy", np.array(ROWS, dtype=np.float32))
    lines = [",".join(COLUMNS)] + [",".join(map(str, row)) for row in ROWS]
    (tmp_path / "rays.csv").write_text("\n".join(lines) + "\n\n")
    turned = [",".join(COLUMNS[::-1])] + [",".join(map(str, row[::-1])) for row in ROWS]
    (tmp_path / "turned.csv").write_text("\ufeff" + "\r\n".join(turned), encoding="utf-8")
    for name in ("rays.npy", "rays.csv", "turned.csv"):
        origins, directions = rays("file", path=name, search_path=[tmp_path])
        assert origins.tolist() == [[0, 0, -1], [1, 1, -1]]
        np.testing.assert_allclose(directions, [[0, 0, 1], [0, 0.6, 0.8]], rtol=1e-15)


HEADER = ",".join(COLUMNS)

BAD_CSV = {
    "a header that lacks a column": (
        "origin_x,origin_y\n1,2",
        "row 1: expected the columns origin_x",
    ),
    "no header": ("0,0,0,0,0,1", "row 1: expected the columns"),
    "no rays": (HEADER, "holds no rays"),
    "too few columns": (f"{HEADER}\n0,0,0,0,0,1\n0,0,1", "row 3: expected 6 columns, got 3"),
    "no number": (f"{HEADER}\n0,0,0,0,0,x", "row 2: could not convert string to float: 'x'"),
    "NaN": (f"{HEADER}\n0,0,0,0,0,1\n\n0,nan,0,0,0,1", "row 4: origin_y is nan"),
    "infinity": (f"{HEADER}\n0,0,0,inf,0,1", "row 2: direction_x is inf"),
    "no direction": (f"{HEADER}\n0,0,0,0,0,1\n0,0,0,0,0,0", "row 3: the direction has length 0"),
    "an open quote": (f'{HEADER}\n0,0,0,0,0,"1', "is not a .csv file"),
    "Python's digits": (f"{HEADER}\n0_5,0,0,0,0,1", "row 2: expected numbers, got 0_5, 0, 0, 0, 0"),
    "no text": ("\0\udcff", "is not a .csv file"),
}


@pytest.mark.parametrize(("text", "message"), BAD_CSV.values(), ids=BAD_CSV)
def test_bad_csv_files_are_refused(tmp_path, text, message):
    path = tmp_path / "rays.csv"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(VolumeError) as error:
        rays("file", path=str(path))
    assert str(error.value).startswith(f"{path}: {message}")


BAD_NPY = {
    "wrong columns": (np.zeros((2, 5)), "expected an array of shape (N, 6), got (2, 5)"),
    "wrong rank": (np.zeros(6), "expected an array of shape (N, 6), got (6,)"),
    "no rays": (np.zeros((0, 6)), "is empty"),
    "NaN": (np.array([ROWS[0], [0, np.nan, 0, 0, 0, 1]]), "row 1: origin_y is nan"),
    "no direction": (np.array([[0.0] * 6]), "row 0: the direction has length 0"),
    "text": (np.array([["a"] * 6]), "holds elements of type <U1"),
}


@pytest.mark.parametrize(("array", "message"), BAD_NPY.values(), ids=BAD_NPY)
def test_bad_npy_files_are_refused(tmp_path, array, message):
    path = tmp_path / "rays.npy"
    np.save(path, array)
    with pytest.raises(VolumeError) as error:
        rays("file", path=str(path))
    assert str(error.value).startswith(f"{path}: {message}")


def test_other_files_of_rays_are_refused(tmp_path):
    path = tmp_path / "rays.txt"
    path.write_text("0 0 0 0 0 1")
    with pytest.raises(VolumeError, match=r"rays.txt: expected rays in a .npy or a .csv file"):
        rays("file", path=str(path))
