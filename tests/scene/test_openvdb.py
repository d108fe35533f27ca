import struct
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from freepath.errors import VolumeError
from freepath.scene import build_medium, segments
from freepath.scene.volumes import openvdb, openvdb_header, openvdb_reader
from freepath.scene.volumes.reading import read_volume
from scene.helpers import volume_model

MAKE_GRIDS = """
import sys
import numpy as np
import pyopenvdb as vdb

densities = np.arange(5 * 7 * 9, dtype=np.float32).reshape(5, 7, 9)
density = vdb.FloatGrid()
density.name = "density"
density.copyFromArray(densities, ijk=(-3, 2, 10))
density.transform = vdb.createLinearTransform(
    [[0, 0.25, 0, 0], [-0.5, 0, 0, 0], [0, 0, 2, 0], [1, 2, 3, 1]]
)
tiles = vdb.FloatGrid()
tiles.name = "tiles"
tiles.fill((0, 0, 0), (15, 15, 15), 2.5)
tiles.prune()
tiles.fill((17, 0, 0), (18, 1, 1), 1.0)
velocity = vdb.Vec3SGrid()
velocity.name = "velocity"
velocity.fill((0, 0, 0), (3, 3, 3), (1, 2, 3))
empty = vdb.FloatGrid()
empty.name = "empty"
frustum = vdb.FloatGrid()
frustum.name = "frustum"
frustum.copyFromArray(densities)
frustum.transform = vdb.createFrustumTransform((0, 0, 0), (10, 10, 10), 0.5, 10.0)
folder = sys.argv[1]
vdb.write(folder + "/many.vdb", grids=[density, tiles, velocity, empty])
vdb.write(folder + "/one.vdb", grids=[tiles])
vdb.write(folder + "/vectors.vdb", grids=[velocity])
vdb.write(folder + "/unclear.vdb", grids=[tiles, empty])
vdb.write(folder + "/frustum.vdb", grids=[frustum])
"""

FLOAT, VECTOR = b"Tree_float_5_4_3", b"Tree_vec3s_5_4_3"
READERS = ("read_with_openvdb", "read_with_openimageio")


def run(code, *arguments):
    command = [openvdb.SYSTEM_PYTHON, "-I", "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def table(*grids, version=224):
    """An OpenVDB file of a table of contents alone: (name, type, start, end) of each grid."""

    def text(word):
        return struct.pack("<I", len(word)) + word

    head = struct.pack("<qIII?36sII", openvdb_header.MAGIC, version, 9, 1, True, b"", 0, len(grids))
    for name, kind, start, end in grids:
        head += text(name) + text(kind) + text(b"") + struct.pack("<qqq", start, start, end)
    return head


@pytest.fixture(scope="module")
def grids(tmp_path_factory):
    """Return a folder with OpenVDB files, written by Debian's python3-openvdb."""
    folder = tmp_path_factory.mktemp("grids")
    if not Path(openvdb.SYSTEM_PYTHON).exists() or run("import pyopenvdb").returncode:
        pytest.skip("python3-openvdb is not installed")
    done = run(MAKE_GRIDS, folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(params=READERS)
def one_reader(request, monkeypatch, tmp_path):
    """Read OpenVDB files by one reader alone, in a process of the system's Python."""
    module = "pyopenvdb" if request.param == "read_with_openvdb" else "OpenImageIO"
    if run(f"import {module}").returncode:
        pytest.skip(f"the system's Python has no {module}")
    other = next(name for name in READERS if name != request.param)
    script = tmp_path / "one_reader.py"
    text = Path(openvdb_reader.__file__).read_text()
    silenced = f"def {other}(*_):\n    return None\n\n\ndef unused(request):"
    script.write_text(text.replace(f"def {other}(request):", silenced))
    monkeypatch.setattr(openvdb, "interpreters", lambda: [openvdb.SYSTEM_PYTHON])
    monkeypatch.setattr(openvdb_reader, "__file__", str(script))


@pytest.mark.usefixtures("one_reader")
class TestBothReaders:
    def test_densities_and_transform(self, grids):
        volume = openvdb.read_openvdb(grids / "many.vdb", None)
        expected = np.arange(5 * 7 * 9).reshape(5, 7, 9).transpose(2, 1, 0)
        assert volume.densities.tolist() == expected.tolist()
        assert sorted(volume.others) == ["empty", "tiles", "velocity (of vec3s)"]
        # the centre of the first voxel is index (-3, 2, 10); i goes along y, j against x
        assert volume.first == (10, 2, -3)
        to_world = volume.to_world
        center = to_world @ [0.5, 0.5, 0.5, 1.0]
        assert center.tolist() == [1 - 2 * 0.5, 2 - 3 * 0.25, 3 + 10 * 2]
        assert to_world[:, :3].tolist() == [[0, -0.5, 0], [0.25, 0, 0], [0, 0, 2]]

    def test_a_grid_by_name_with_constant_tiles(self, grids):
        for file, name in [("many.vdb", "tiles"), ("one.vdb", None)]:
            densities = openvdb.read_openvdb(grids / file, name).densities
            expected = np.zeros((16, 16, 19))
            expected[:, :, :16] = 2.5
            expected[:2, :2, 17:] = 1.0
            assert densities.tolist() == expected.tolist()

    @pytest.mark.parametrize(
        ("file", "grid", "message"),
        [
            ("many.vdb", "smoke", "no grid 'smoke' of scalars, expected one of: density, empty, t"),
            ("many.vdb", "velocity", "'velocity (of vec3s)' is no grid of scalars"),
            ("many.vdb", "empty", "the grid is empty: it has no active voxels"),
            ("unclear.vdb", None, "it holds several grids, choose one of: empty, tiles"),
            ("vectors.vdb", None, "it holds no grid of scalars"),
            ("frustum.vdb", None, "frustum transform, expected"),
            ("damaged.vdb", None, "it is not an OpenVDB file, or a truncated one: "),
        ],
    )
    def test_refusals(self, grids, file, grid, message):
        content = (grids / "one.vdb").read_bytes()
        (grids / "damaged.vdb").write_bytes(content.replace(b"ScaleMap", b"Scal\0\nap"))
        with pytest.raises(VolumeError) as error:
            openvdb.read_openvdb(grids / file, grid)
        text = str(error.value)
        assert text.startswith(f"{grids / file}: ")
        assert message in text
        assert text.isprintable()

    def test_a_bad_voxel_is_named_as_in_the_file(self, grids):
        code = (
            "import sys, pyopenvdb as vdb\n"
            "grid = vdb.FloatGrid()\n"
            "grid.fill((-3, 2, 10), (5, 4, 12), 1.0)\n"
            "grid.fill((4, 3, 11), (4, 3, 11), -0.25)\n"
            "vdb.write(sys.argv[1], grids=[grid])"
        )
        path = grids / "negative.vdb"
        assert not run(code, path).returncode
        with pytest.raises(VolumeError) as error:
            build_medium(volume_model(path))
        what = "1 negative (first [z, y, x] = [11, 3, 4]: -0.25)"
        assert str(error.value) == f"{path}: densities that cannot be used: {what}"

    @pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
    def test_a_voxel_too_large_for_half_is_named_as_in_the_file(self, grids, interpolation):
        code = (
            "import sys, pyopenvdb as vdb\n"
            "grid = vdb.FloatGrid()\n"
            "grid.fill((-3, 2, 10), (5, 4, 12), 1.0)\n"
            "grid.fill((4, 3, 11), (5, 3, 11), 32768.0)\n"
            "vdb.write(sys.argv[1], grids=[grid])"
        )
        path = grids / "large.vdb"
        assert not run(code, path).returncode
        medium = build_medium(volume_model(path, sigma_t=2.0, interpolation=interpolation))
        with pytest.raises(VolumeError) as error:
            medium.stored("half")
        assert str(error.value).startswith(f"{path}: 2 voxels are too large for storage half")
        assert "(first [z, y, x] = [11, 3, 4]: extinction 65536, " in str(error.value)

    def test_too_many_voxels(self, grids, monkeypatch):
        monkeypatch.setattr(openvdb, "MOST_VOXELS", 314)
        with pytest.raises(VolumeError, match="the grid has 315 voxels, expected at most 314"):
            openvdb.read_openvdb(grids / "many.vdb", "density")

    def test_the_real_cloud_is_its_npy_voxel_for_voxel(self, real_volumes):
        volume = openvdb.read_openvdb(real_volumes / "wdas_cloud_sixteenth.vdb", None)
        densities, to_world = volume.densities, volume.to_world
        expected = np.load(real_volumes / "cloud_wdas16.npy")
        assert densities.dtype == expected.dtype
        assert np.array_equal(densities, expected)
        size = 10.0 / 3.0
        np.testing.assert_allclose(to_world[:, :3], np.eye(3) * size, rtol=1e-6)
        np.testing.assert_allclose(to_world[:, 3] / size, [-66.5, -21.5, -90.5], rtol=1e-6)


def test_a_file_that_is_cut_anywhere_is_refused(grids, tmp_path, monkeypatch):
    # before OpenVDB sees it, which may run for minutes on what lies beyond the end
    monkeypatch.setattr(openvdb, "_read_there", lambda *_: pytest.fail("read a truncated file"))
    content = (grids / "many.vdb").read_bytes()
    path = tmp_path / "cut.vdb"
    for size in [*range(9, len(content), 101), len(content) - 1]:
        path.write_bytes(content[:size])
        with pytest.raises(VolumeError, match="cut.vdb: is truncated, its grids go on beyond"):
            openvdb.read_openvdb(path, None)


def test_what_is_no_openvdb_file_is_refused(tmp_path):
    (tmp_path / "v.vdb").write_text("this is not a volume")
    with pytest.raises(VolumeError, match="v.vdb: is not an OpenVDB file"):
        openvdb.read_openvdb(tmp_path / "v.vdb", None)


@pytest.fixture
def stub(tmp_path):
    """Return a file that is OpenVDB by its table of contents, and holds nothing else."""
    path = tmp_path / "v.vdb"
    path.write_bytes(table((b"density", FLOAT, 0, 0)))
    return path


def test_a_medium_from_openvdb_is_where_the_file_says(grids):
    medium = build_medium(volume_model(grids / "many.vdb", sigma_t=2.0))
    corners = medium.world_box()
    # voxel edges, half a voxel before the first centre: x = 1 - 0.5 j, y = 2 + 0.25 i, z = 3 + 2 k
    assert corners.min(axis=0).tolist() == [1 - 0.5 * 8.5, 2 + 0.25 * -3.5, 3 + 2 * 9.5]
    assert corners.max(axis=0).tolist() == [1 - 0.5 * 1.5, 2 + 0.25 * 1.5, 3 + 2 * 18.5]
    # index (-3, 2, 10) holds 0, (-2, 2, 10) holds 63
    second = np.array([1 - 0.5 * 2, 2 + 0.25 * -2, 3 + 2 * 10])
    position = medium.to_medium @ np.append(second, 1.0)
    assert medium.sigma_t(position[None])[0] == 126.0


def test_the_two_files_of_the_real_cloud_make_the_same_medium(real_volumes, grids):
    unit = volume_model("wdas_cloud_sixteenth.vdb", sigma_t=40.0, voxel_size=(1.0, 1.0, 1.0))
    from_vdb = build_medium(unit, [real_volumes])
    from_npy = build_medium(volume_model("cloud_wdas16.npy", sigma_t=40.0), [real_volumes])
    assert from_vdb.fingerprint == from_npy.fingerprint
    assert from_npy.extent.tolist() == [126.0, 86.0, 154.0]


def test_without_a_reader_the_packages_to_install_are_named(stub, monkeypatch):
    monkeypatch.setattr(openvdb, "interpreters", list)
    with pytest.raises(VolumeError) as error:
        openvdb.read_openvdb(stub, None)
    text = str(error.value)
    assert text.startswith(f"{stub}: nothing here reads OpenVDB")
    assert "python3-openvdb" in text
    assert "python3-openimageio" in text


ENTRY = openvdb_header.Entry("density", None, "float", 0, 0)


def test_a_python_without_a_reader_says_so(stub):
    # this Python, whose OpenImageIO has no OpenVDB and which has no module of OpenVDB
    if openvdb.interpreters()[:1] == [sys.executable]:
        pytest.skip("this Python has a module of OpenVDB, or an OpenImageIO that reads it")
    voxels, answer, words = openvdb._read_there(sys.executable, stub, ENTRY)
    assert (voxels, answer, words) == (None, {"unread": ["OpenImageIO"]}, "")


@pytest.fixture
def reader_that(monkeypatch, tmp_path):
    """Let the reader's process do something else first."""

    def replace(code):
        script = tmp_path / "reader.py"
        head = "def read_with_openvdb(request):\n"
        text = Path(openvdb_reader.__file__).read_text()
        assert head in text
        script.write_text(text.replace(head, f"{head}    {code}\n"))
        monkeypatch.setattr(openvdb_reader, "__file__", str(script))

    return replace


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (
            "bytearray(4 << 30)",
            r"it is damaged: reading it takes more than 1\.69 GiB, the limit for",
        ),
        ("while True: pass", "cannot be read: that took more than 1 s for"),
        ("__import__('time').sleep(60)", "cannot be read: that took more than 1 s for"),
        ("__import__('os').abort()", "cannot be read: .* failed with status -6"),
        ("raise ValueError('\x1b[2Jodd')", "cannot be read: ValueError: .2Jodd"),
    ],
)
def test_the_reader_has_limits_and_may_end(stub, reader_that, monkeypatch, code, message):
    monkeypatch.setattr(openvdb, "SECONDS", 1)
    monkeypatch.setattr(openvdb, "SECONDS_PER_MIB", 0)
    reader_that(code)
    with pytest.raises(VolumeError, match=message):
        openvdb._read_there(sys.executable, stub, ENTRY)


def test_what_libraries_print_is_passed_on_and_is_no_answer(stub, reader_that):
    reader_that("print('\x1b[35m WARN: old file\x1b[0m'); print('{}')")
    _, answer, words = openvdb._read_there(sys.executable, stub, ENTRY)
    assert "unread" in answer
    assert words == "WARN: old file; {}"


CHOICES = {
    "the only one": ([(b"smoke", FLOAT)], None, "smoke"),
    "beside another type": ([(b"smoke", FLOAT), (b"p", b"Tree_ptdataidx32_5_4_3")], None, "smoke"),
    "density": ([(b"a", FLOAT), (b"density", FLOAT)], None, "density"),
    "by name": ([(b"a", FLOAT), (b"density", FLOAT)], "a", "a"),
    "nameless": ([(b"\x1e0", FLOAT), (b"heat", FLOAT)], "", ""),
    "first of two": ([(b"density\x1e0", FLOAT), (b"density\x1e1", FLOAT)], "density", "density"),
    "second": ([(b"density\x1e0", FLOAT), (b"density\x1e1", FLOAT)], "density[1]", "density[1]"),
    "halves": ([(b"density", b"Tree_float_5_4_3_HalfFloat")], None, "density"),
}
UNCLEAR = {
    "vectors": ([(b"density", VECTOR), (b"t", FLOAT)], "no grid of scalars, expected one of: t"),
    "truth": ([(b"density", b"Tree_bool_5_4_3"), (b"t", FLOAT)], "'density (of bool)' is no grid"),
    "two": ([(b"density\x1e0", FLOAT), (b"density\x1e1", FLOAT)], "of: density, density[1]"),
    "none called density": ([(b"\x1e0", FLOAT), (b"heat", FLOAT)], "of: '' (nameless), heat"),
    "no scalars": ([(b"v\x1b", VECTOR)], "it holds no grid of scalars: v? (of vec3s)"),
}


@pytest.mark.parametrize(("grids", "wanted", "found"), CHOICES.values(), ids=CHOICES)
def test_which_grid_is_read(tmp_path, grids, wanted, found):
    path = tmp_path / "v.vdb"
    path.write_bytes(table(*[(*grid, 0, 0) for grid in grids]))
    assert openvdb_header.choose(path, openvdb_header.contents(path), wanted).shown == found


@pytest.mark.parametrize(("grids", "message"), UNCLEAR.values(), ids=UNCLEAR)
def test_no_other_grid_is_read_in_its_place(tmp_path, grids, message):
    path = tmp_path / "v.vdb"
    path.write_bytes(table(*[(*grid, 0, 0) for grid in grids]))
    with pytest.raises(VolumeError) as error:
        openvdb.read_openvdb(path, None)
    assert message in str(error.value)


@pytest.mark.parametrize(("start", "end"), [(0, 2**63 - 1), (0, -1), (-5, 0), (9, 8), (0, 2**62)])
def test_offsets_out_of_range(tmp_path, start, end):
    path = tmp_path / "v.vdb"
    path.write_bytes(table((b"density", FLOAT, start, end), (b"heat", FLOAT, 0, 0)))
    with pytest.raises(VolumeError, match="is truncated"):
        openvdb.read_openvdb(path, None)


OTHERS = """
import sys
import pyopenvdb as vdb

grids = []
for name, value in (("density", 1.5), ("density", 2.5), ("", 3.5)):
    grid = vdb.FloatGrid()
    grid.name = name
    grid.fill((0, 0, 0), (3, 2, 1), value)
    grids.append(grid)
vdb.write(sys.argv[1] + "/three.vdb", grids=grids)
grids[1].name = "second"
vdb.write(sys.argv[1] + "/two.vdb", grids=grids[:2])
vdb.write(sys.argv[1] + "/one.vdb", grids=grids[:1])
vdb.write(sys.argv[1] + "/level.vdb", grids=[vdb.createLevelSetSphere(5.0)])
grids[0].fill((1200, 1200, 1200), (1200, 1200, 1200), 1.0)
vdb.write(sys.argv[1] + "/empty.vdb", grids=grids[:1])
endless = vdb.FloatGrid(background=0.25)
endless.name = "density"
endless.fill((2, 3, 4), (3, 3, 4), 1.5)
endless["a note"] = "of any length"
rows = [[1, 0.5, 0, 0], [0, 2, 0, 0], [0, 0, 3, 0], [1, 2, 3, 1]]
turned = [[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
moved, scaled = vdb.createLinearTransform(0.5), vdb.createLinearTransform()
moved.translate((1, 2, 3))
scaled.scale((1, 2, 3))
for number, one in enumerate([moved, scaled, rows, turned, 2.0]):
    chosen = one if isinstance(one, vdb.Transform) else vdb.createLinearTransform(one)
    endless.transform = chosen
    vdb.write(sys.argv[1] + f"/endless{number}.vdb", grids=[endless])
"""


@pytest.fixture(scope="module")
def odd(grids, tmp_path_factory):
    """Return a folder with OpenVDB files that are sound, but not the usual ones."""
    folder = tmp_path_factory.mktemp("odd")
    done = run(OTHERS, folder)
    assert done.returncode == 0, done.stderr
    one, two = (folder / f"{name}.vdb" for name in ("one", "two"))
    # the second type in the table of contents becomes one that the module lacks
    before, after = two.read_bytes().split(b"second", 1)
    two.write_bytes(before + b"second" + after.replace(b"Tree_float", b"Tree_vec3d", 1))
    (folder / "whole.vdb").write_bytes(one.read_bytes().replace(FLOAT, b"Tree_int32_5_4_3", 1))
    (folder / "newer.vdb").write_bytes(one.read_bytes().replace(b"\xe0\0\0\0", b"\xe1\0\0\0", 1))
    return folder


@pytest.mark.usefixtures("one_reader")
class TestOddFiles:
    @pytest.mark.parametrize(
        ("file", "grid", "value"),
        [
            ("two.vdb", None, 1.5),
            ("three.vdb", "density", 1.5),
            ("three.vdb", "density[1]", 2.5),
            ("three.vdb", "", 3.5),
            ("newer.vdb", None, 1.5),
        ],
    )
    def test_what_can_be_read_is(self, odd, file, grid, value):
        volume = openvdb.read_openvdb(odd / file, grid)
        assert volume.densities.tolist() == np.full((2, 3, 4), value).tolist()
        told = volume.told
        assert "of float, active box [0, 0, 0] to [3, 2, 1] [x, y, z], background " in told
        assert ("got version 225" in told) == (file == "newer.vdb")

    def test_a_type_that_no_reader_has(self, odd):
        wanted = "grid density is of int32, which (pyopenvdb|OpenImageIO) cannot read"
        with pytest.raises(VolumeError, match=wanted):
            openvdb.read_openvdb(odd / "whole.vdb", None)

    def test_a_background_that_would_never_end_is_refused(self, odd):
        with pytest.raises(VolumeError, match="its background is 0.25: outside of its active box"):
            read_volume(odd / "endless0.vdb")

    def test_a_box_that_is_not_in_the_file(self, odd):
        with pytest.raises(VolumeError, match="box has 1732323601 voxels, 6.45 GiB, hardly any in"):
            openvdb.read_openvdb(odd / "empty.vdb", None)


def test_a_level_set_is_called_one(odd, monkeypatch):
    with pytest.raises(VolumeError, match="the grid is a level set, which holds distances"):
        openvdb.read_openvdb(odd / "level.vdb", None)


def test_a_reader_that_crashes_is_an_error(stub, monkeypatch):
    monkeypatch.setattr(openvdb, "interpreters", lambda: ["/bin/false"])
    with pytest.raises(VolumeError, match="cannot be read: /bin/false failed with status 1"):
        openvdb.read_openvdb(stub, None)


def test_the_reader_needs_nothing_of_freepath():
    assert "freepath" not in {
        line.split()[1].split(".")[0]
        for line in Path(openvdb_reader.__file__).read_text().splitlines()
        if line.startswith(("import ", "from "))
    }


def test_a_background_is_found_behind_every_transform(odd, monkeypatch):
    for number in range(5):
        path = odd / f"endless{number}.vdb"
        (entry,) = openvdb_header.contents(path)
        assert openvdb_header.background(path, entry) == 0.25
    monkeypatch.setattr(openvdb_header, "MAP_BYTES", {})
    assert openvdb_header.background(path, entry) is None


def test_rays_that_leave_the_active_box_leave_the_medium(odd):
    medium = build_medium(volume_model(odd / "one.vdb", sigma_t=2.0))
    origins = np.array([[1.0, 1, 0], [1, 1, -9], [1, 1, 2], [9, 1, 0]])
    directions = np.tile([0.0, 0.0, 1.0], (4, 1))
    found = medium.optical_depth(segments(origins, directions, medium))
    # the box is 2 long and centred at 0.5; from its middle, from outside, behind it, beside it
    assert found.tolist() == [2 * 1.5 * length for length in (1.5, 2, 0, 0)]


def test_what_a_name_claims_is_not_allocated(tmp_path):
    content = table((b"density", FLOAT, 0, 0))
    place = content.index(b"density") - 4
    (tmp_path / "v.vdb").write_bytes(content[:place] + b"\xff" * 4 + content[place + 4 :])
    tracemalloc.start()
    try:
        with pytest.raises(VolumeError, match="is truncated"):
            openvdb_header.contents(tmp_path / "v.vdb")
        assert tracemalloc.get_traced_memory()[1] < 1 << 27
    finally:
        tracemalloc.stop()
