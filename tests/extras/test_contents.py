import json
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from freepath import cli, config
from freepath.compose import catalog
from freepath.config.models import Grid
from freepath.extras import contents
from freepath.scene import build_medium, majorants, segments, survey
from freepath.scene.media.grid import GridMedium
from freepath.scene.volumes.reading import Volume
from scene.helpers import voxels

SHAPE = (6, 9, 20)
DENSITIES = voxels(SHAPE, 3.0)
SHEARED = np.array([[0.5, 0.1, 0, 1], [0, 0, -2, 2], [0, 0.25, 0.3, 3]])


def contents_of(densities=DENSITIES, to_world=SHEARED, **keys):
    volume = Volume("v.npy", densities, to_world)
    return contents.Contents(volume, {"file": "v.npy", "sigma_t": 2.0} | keys)


@pytest.mark.parametrize("cells", [(1, 1, 1), (5, 3, 2), (20, 9, 6), (7, 4, 3)])
def test_the_work_of_majorants_is_their_integral_along_rays(cells):
    medium = GridMedium(DENSITIES, np.eye(3, 4), "trilinear")
    upper = medium.bounds(cells)[1]
    middles = [
        (np.arange(n) + 0.5) * extent / n for n, extent in zip(cells, (20, 9, 6), strict=True)
    ]
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        grid = np.meshgrid(*(middles[a] for a in others), indexing="ij")
        origins = np.full((grid[0].size, 3), -1.0)
        origins[:, others] = np.stack([one.ravel() for one in grid], axis=1)
        directions = np.broadcast_to(np.eye(3)[axis], origins.shape)
        found = survey.work(medium, segments(origins, directions, medium), cells)
        through = upper.sum(axis=2 - axis) * medium.extent[axis] / cells[axis]
        assert found.lookups == pytest.approx(through.mean(), rel=1e-6)  # float32 majorants
        assert found.crossings == cells[axis] - 1
    # a diagonal through corners is in no cell beside
    across = segments(np.zeros((1, 3)), np.array([[20, 9, 6]]) / np.sqrt(517), medium)
    assert survey.work(medium, across, (3, 3, 3)).crossings == 2


def test_misses_have_no_work():
    medium = GridMedium(DENSITIES, np.eye(3, 4), "nearest")
    away = segments(np.full((1, 3), -1.0), np.array([[0.0, 0, -1]]), medium)
    assert survey.work(medium, away, (4, 4, 4)).steps == 0


@pytest.mark.parametrize("interpolation", ["trilinear", "nearest"])
@pytest.mark.parametrize("shape", [SHAPE, (1, 9, 1)])
def test_a_projection_is_the_optical_depth_through_the_middles_of_voxels(interpolation, shape):
    densities = DENSITIES[: shape[0], :, : shape[2]]
    found = contents_of(densities, interpolation=interpolation)
    medium, to_world = found.medium, np.linalg.inv(found.medium.to_medium[:, :3])
    for axis, name in enumerate("xyz"):
        depths, (height, width), told = found.projection(name)
        across, up = (a for a in range(3) if a != axis)
        y, x = np.divmod(np.arange(depths.size), depths.shape[1])
        at = np.zeros((depths.size, 3))
        at[:, across], at[:, up] = x + 0.5, depths.shape[0] - y - 0.5
        length = np.linalg.norm(to_world[:, axis]) * medium.extent[axis]
        along = np.eye(3)[axis] * medium.extent[axis] / length
        rays = np.column_stack([at, np.tile(along, (len(at), 1)), np.full(len(at), length)])
        np.testing.assert_allclose(depths.ravel(), medium.optical_depth(rays), rtol=1e-12)
        assert told == name
        sides = [np.linalg.norm(to_world[:, a]) for a in (up, across)]
        assert (height, width) == pytest.approx(tuple(sides))


def test_facts_are_of_the_file():
    densities = np.zeros((16, 8, 24), np.uint16)
    densities[:3, 2:4, 5] = [[7, 9], [1, 2], [3, 400]]
    found = contents_of(densities, np.eye(3, 4)).facts()
    assert json.loads(json.dumps(found)) | found == found
    numbers = [found[name] for name in ("minimum", "maximum", "mean", "empty_share")]
    assert numbers == [0, 400, pytest.approx(densities.mean()), 1 - 6 / densities.size]
    assert found["empty_cells_share"] == 5 / 6
    assert found["voxels_xyz"] == (24, 8, 16)
    assert found["bytes_float"] == 4 * densities.size
    assert found["optical_depth_of_a_voxel"] == 800
    least = min(found["majorants"], key=lambda one: one["lookups"] + one["crossings"])
    assert least["cells"] == found["majorant"] != (1, 1, 1)
    model = Grid(resolution=found["majorant"])
    medium = GridMedium(densities.astype(np.float32), np.eye(3, 4), "trilinear")
    built = majorants.build(model, medium, medium.bounds(found["majorant"]), 1.0)
    assert found["bytes_majorant"] == built.data.nbytes
    text = "\n".join(contents.text(found))
    assert "24 x 8 x 16 voxels along x, y, z of uint16, each 1 x 1 x 1" in text
    assert "turned or sheared" not in text
    assert "turned or sheared" in "\n".join(contents.text(contents_of().facts()))
    assert contents_of(DENSITIES[:1]).facts()["voxel_sides"] == pytest.approx(
        np.linalg.norm(SHEARED[:, :3], axis=0)
    )


def test_the_memory_told_holds_what_it_takes():
    densities = voxels((64, 100, 120))
    tracemalloc.start()
    try:
        found = contents_of(densities).facts()
        peak = tracemalloc.get_traced_memory()[1] + densities.nbytes
    finally:
        tracemalloc.stop()
    assert peak < found["bytes_here"] < 2 * peak


def test_other_sizes_keep_the_mean():
    depths = np.arange(15.0).reshape(3, 5) ** 2
    for rows, columns in [(3, 5), (6, 10), (2, 3), (1, 1), (7, 4)]:
        found = contents.resized(depths, rows, columns)
        assert found.shape == (rows, columns)
        assert found.mean() == pytest.approx(depths.mean())
    assert contents.resized(depths, 6, 10)[::2, 1::2] == pytest.approx(depths)
    assert contents.resized(depths, 1, 5)[0] == pytest.approx(depths.mean(axis=0))


def test_a_picture_stands_upright_with_square_pixels():
    depths = np.zeros((4, 4))
    depths[0, 0], depths[3] = 1.0, 0.5
    drawing = contents.drawn(depths, (1.0, 1.0), 40, 4)
    assert drawing[0] == "@@"
    assert [len(line) for line in drawing] == [2, 0, 0, 8]
    assert len(contents.drawn(depths, (1.0, 4.0), 40, 99)) == 5


class TestCommand:
    @pytest.fixture
    def call(self, tmp_path, monkeypatch, capsys):
        monkeypatch.chdir(tmp_path)
        np.save("v.npy", DENSITIES)

        def call(*arguments):
            code = cli.main(["volume", *arguments])
            said = capsys.readouterr()
            assert "Traceback" not in said.err
            return SimpleNamespace(code=code, out=said.out, err=said.err)

        return call

    def test_its_lines_make_the_same_medium_in_a_config(self, call, tmp_path):
        asked = ("v.npy", "--sigma-t", "30", "--voxel-size", "0.5,1,2")
        said = call(*asked, "-o", "v.png")
        assert said.code == 0
        lines = said.out.partition("in the matrix of a config:\n\n")[2].splitlines()[:2]
        head = ["name: x", "rays: {chords: {count: 9}}", "matrix:", *lines, "  tracker: ratio"]
        (tmp_path / "x.yaml").write_text("\n".join([*head, "stop: {samples: 8}"]))
        known = catalog.load([]).parameter_models()
        matrix = config.load(tmp_path / "x.yaml", known).matrix
        (medium,), (majorant,) = matrix.medium, matrix.majorant
        facts = json.loads(call(*asked, "--json").out)
        assert majorant.as_dict() == {"grid": {"resolution": facts["majorant"]}}
        expected = GridMedium(DENSITIES * np.float32(30), np.diag([2, 1, 0.5, 0])[:3], "trilinear")
        assert build_medium(medium).mean() == pytest.approx(expected.mean())
        assert build_medium(medium).to_medium.tolist() == expected.to_medium.tolist()
        assert facts["voxel_sides"] == [0.5, 1, 2]

    def test_the_picture_is_a_png_of_square_pixels(self, call):
        import OpenImageIO as oiio

        assert "wrote v.png" in call("v.npy", "--along", "z", "-o", "v.png").out
        spec = oiio.ImageInput.open("v.png").spec()
        assert (spec.width, spec.height) == (20, 9)

    @pytest.mark.parametrize(
        ("arguments", "told"),
        [
            ("no.npy", "no.npy: no such file in "),
            ("v.npy --grid x", "only OpenVDB and NanoVDB files have named grids"),
            ("v.npy -o v.jpg", "v.jpg: expected a name that ends in .png"),
            ("v.npy --raw 2x2", "expected voxels along x, y, z, a type and a byte order"),
            (
                "v.npy --raw '2x2x2 uint16'",
                "expected voxels along x, y, z, a type and a byte order",
            ),
            ("v.npy --voxel-size 1,2", "expected one or three numbers, got '1,2'"),
            ("v.npy --voxel-size 1,2,0", "expected a number above 0, got '0'"),
        ],
    )
    def test_mistakes(self, call, capsys, arguments, told):
        import shlex

        try:
            said = call(*shlex.split(arguments))
        except SystemExit as left:
            said = SimpleNamespace(code=left.code, err=capsys.readouterr().err)
        assert said.code == 2
        assert told in " ".join(said.err.split())
