import os

import numpy as np
import pytest

from freepath.errors import VolumeError
from freepath.scene.volumes.files import find_file
from freepath.scene.volumes.reading import extinction, read_volume

pytestmark = pytest.mark.filterwarnings("error")

DENSITIES = np.arange(24.0).reshape(2, 3, 4)


@pytest.mark.parametrize(
    "array",
    [
        DENSITIES.astype(np.float32),
        DENSITIES.astype(np.float16),
        DENSITIES,
        DENSITIES.astype(np.uint8),
        DENSITIES.astype(">i4"),
        np.asfortranarray(DENSITIES),
        DENSITIES > 5,
    ],
    ids=lambda array: array.dtype.str + "CF"[array.flags.f_contiguous],
)
def test_npy_of_any_real_type(tmp_path, array):
    np.save(tmp_path / "v.npy", array)
    volume = read_volume(tmp_path / "v.npy")
    found = extinction(volume.densities, 2.0, "v")
    assert found.dtype == np.float32
    assert found.flags.c_contiguous
    assert found.tolist() == (2.0 * array.astype(float)).tolist()
    assert volume.to_world.tolist() == np.eye(3, 4).tolist()


def test_bytes_are_not_normalised(tmp_path):
    np.save(tmp_path / "v.npy", np.full((1, 1, 1), 255, np.uint8))
    densities = read_volume(tmp_path / "v.npy").densities
    assert extinction(densities, 1.0, "v")[0, 0, 0] == 255.0


def test_products_are_rounded_once():
    value, scale = np.float32(0.1), 0.3
    found = extinction(np.full((1, 1, 1), value), scale, "v")[0, 0, 0]
    assert found == np.float32(np.float64(value) * scale)


def test_a_volume_of_zeros_is_allowed():
    assert not extinction(np.zeros((2, 2, 2)), 1.0, "v").any()
    assert not extinction(-np.zeros((2, 2, 2)), 1.0, "v").any()


def with_values(**values):
    """Return a volume with some values, by place: _zyx=value."""
    array = np.array(DENSITIES)
    for place, value in values.items():
        array[tuple(map(int, place[1:]))] = value
    return array


REFUSED = {
    "NaN": (with_values(_012=np.nan, _123=np.nan), "2 NaN (first [z, y, x] = [0, 1, 2]: nan)"),
    "infinite": (with_values(_102=np.inf), "1 infinite (first [z, y, x] = [1, 0, 2]: inf)"),
    "minus infinity": (with_values(_102=-np.inf), "1 infinite (first [z, y, x] = [1, 0, 2]: -inf)"),
    "negative": (with_values(_000=-1e-300), "1 negative (first [z, y, x] = [0, 0, 0]: -1e-300)"),
    "large": (
        with_values(_121=1e38, _122=2e38),
        "2 too large for float32 once multiplied by sigma_t = 10 "
        "(first [z, y, x] = [1, 2, 1]: 1e+38)",
    ),
    "all of them": (
        with_values(_123=np.nan, _122=-1, _121=np.inf),
        "1 infinite (first [z, y, x] = [1, 2, 1]: inf), "
        "1 negative (first [z, y, x] = [1, 2, 2]: -1)",
    ),
}


@pytest.mark.parametrize(("array", "message"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_density_is_refused_with_its_place_and_count(array, message):
    with pytest.raises(VolumeError) as error:
        extinction(array, 10.0, "cloud.npy")
    text = str(error.value)
    assert text.startswith("cloud.npy: densities that cannot be used: ")
    assert all(part in text for part in message.split(", 1 "))
    assert "\n" not in text


def test_what_would_overflow_before_scaling_is_fine():
    assert extinction(np.full((1, 1, 1), 1e100), 1e-100, "v")[0, 0, 0] == 1.0


class Harmful:
    def __reduce__(self):
        return (pytest.fail, ("the file ran code",))


def npy(array, **options):
    return lambda path: np.save(path, array, **options)


def records():
    return np.zeros((2, 2, 2), dtype=[("密度", "f4")])


def truncated(path):
    np.save(path, DENSITIES)
    path.write_bytes(path.read_bytes()[:-9])


BAD_NPY = {
    "empty file": (lambda path: path.write_bytes(b""), "the file is empty"),
    "text": (lambda path: path.write_text("density"), "is not a .npy file"),
    "header only": (lambda path: path.write_bytes(b"\x93NUMPY\x01\x00"), "is not a .npy file"),
    "bad header": (
        lambda path: path.write_bytes(b"\x93NUMPY\x01\x00\x06\x00{(])}\n"),
        "is not a .npy file",
    ),
    "truncated": (truncated, "is truncated, 9 bytes of its array are missing"),
    "rank 2": (npy(DENSITIES[0]), "expected an array of rank 3 [z, y, x], got rank 2"),
    "rank 4": (npy(DENSITIES[None]), "expected an array of rank 3 [z, y, x], got rank 4"),
    "rank 0": (npy(np.float32(3.0)), "expected an array of rank 3 [z, y, x], got rank 0"),
    "no voxels": (npy(np.zeros((3, 0, 2))), "is empty, its shape is (3, 0, 2)"),
    "complex": (npy(DENSITIES + 1j), "holds elements of type complex128, expected real numbers"),
    "text array": (npy(np.full((1, 1, 1), "x")), "holds elements of type <U1"),
    "times": (npy(np.zeros((1, 1, 1), "M8[s]")), "holds elements of type datetime64[s]"),
    "records": (npy(np.zeros((1, 1, 1), [("a", "f4")])), "holds elements of type [('a', '<f4')]"),
    "pickled": (
        npy(np.full((1, 1, 1), Harmful()), allow_pickle=True),
        "holds Python objects (pickled)",
    ),
}


@pytest.mark.parametrize(("write", "message"), BAD_NPY.values(), ids=BAD_NPY)
def test_bad_npy_files_are_refused(tmp_path, write, message):
    path = tmp_path / "v.npy"
    write(path)
    with pytest.raises(VolumeError) as error:
        read_volume(find_file(path))
    assert str(error.value).startswith(f"{path}: {message}")
    assert "\n" not in str(error.value)


def test_records_with_names_in_any_script_are_refused(tmp_path):
    with pytest.warns(UserWarning):
        np.save(tmp_path / "v.npy", records())
    with pytest.raises(VolumeError, match="holds records"):
        read_volume(tmp_path / "v.npy")


def test_too_many_voxels_are_refused(tmp_path, monkeypatch):
    np.save(tmp_path / "v.npy", DENSITIES)
    monkeypatch.setattr("freepath.scene.volumes.reading.MOST_VOXELS", 23)
    with pytest.raises(VolumeError, match="24 voxels, expected at most 23"):
        read_volume(tmp_path / "v.npy")


def test_only_openvdb_has_named_grids(tmp_path):
    np.save(tmp_path / "v.npy", DENSITIES)
    with pytest.raises(VolumeError, match="grid 'density': only OpenVDB and NanoVDB files"):
        read_volume(tmp_path / "v.npy", "density")


def test_files_are_looked_for_beside_the_config_then_in_the_variable_then_here(
    tmp_path, monkeypatch
):
    folders = [tmp_path / name for name in ("config", "first", "second", "here")]
    for folder in folders:
        folder.mkdir()
        (folder / "v.npy").write_text("x")
    monkeypatch.setenv("FREEPATH_VOLUMES", f"{folders[1]}:{folders[2]}")
    monkeypatch.chdir(folders[3])
    for folder in folders:
        found = find_file("v.npy", [folders[0]])
        assert found.resolve() == (folder / "v.npy").resolve()
        found.unlink()
    with pytest.raises(VolumeError) as error:
        find_file("v.npy", [folders[0]])
    looked = ", ".join(map(str, folders))
    assert str(error.value) == f"v.npy: no such file in {looked}"


def test_without_the_variable_the_error_names_it(tmp_path, monkeypatch):
    monkeypatch.delenv("FREEPATH_VOLUMES", raising=False)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(VolumeError) as error:
        find_file("v.npy")
    hint = "FREEPATH_VOLUMES may name more folders"
    assert str(error.value) == f"v.npy: no such file in {tmp_path}; {hint}"


def test_folders_and_unreadable_files_are_refused(tmp_path):
    with pytest.raises(VolumeError, match="is a folder, expected a file"):
        find_file(tmp_path)
    path = tmp_path / "v.npy"
    path.write_text("x")
    path.chmod(0)
    try:
        path.read_text()
    except PermissionError:
        with pytest.raises(VolumeError, match="cannot be read: Permission denied"):
            find_file(path)
    else:
        pytest.skip("this user may read every file")


@pytest.mark.parametrize("shape", ["(2, -3, -4)", "(2, True, 4)", "(2, None, 4)", "(2.0, 3, 4)"])
def test_shapes_that_are_none(tmp_path, shape):
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    content = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()
    (tmp_path / "v.npy").write_bytes(content + bytes(96))
    with pytest.raises(VolumeError, match="is damaged, its shape is|is not a .npy file: "):
        read_volume(tmp_path / "v.npy")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("~nosuchuser/v.npy", "~nosuchuser/v.npy: Could not determine home directory"),
        ("n" * 300 + ".npy", "cannot be looked for: .*File name too long"),
        ("a\0b.npy", "no such file|cannot be looked for: embedded null byte"),
    ],
)
def test_names_that_no_file_can_have(name, message):
    with pytest.raises(VolumeError, match=message):
        find_file(name)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "v.npy")
    with pytest.raises(VolumeError, match="v.npy: is a pipe or a device, expected a file"):
        find_file(tmp_path / "v.npy")


@pytest.mark.parametrize("name", ["v.npz", "v.npy.gz", "v.raw", "v"])
def test_which_formats_are_read_is_told(tmp_path, name):
    (tmp_path / name).write_bytes(b"\x1f\x8b" + bytes(100))
    with pytest.raises(VolumeError, match=r"expected .npy, EXR, .* or raw numbers, whose"):
        read_volume(tmp_path / name)


def test_what_was_read_is_told(tmp_path):
    np.save(tmp_path / "v.npy", DENSITIES)
    volume = read_volume(tmp_path / "v.npy")
    assert volume.told == f"{tmp_path / 'v.npy'}: 2 x 3 x 4 voxels [z, y, x] of float64"
