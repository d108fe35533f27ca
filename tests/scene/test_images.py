import numpy as np
import pytest
from freepath.errors import VolumeError
from freepath.scene import build_medium
from freepath.scene.volumes import extinction, read_volume

from scene.helpers import volume_model, write_slices

pytestmark = pytest.mark.filterwarnings("error")

RNG = np.random.default_rng(6)
DENSITIES = 200.0 * RNG.random((5, 6, 7))
OPTIONS = [[("compression", "none")], [("compression", "zip")], [("tiff:bigtiff", 1)]]


@pytest.mark.parametrize(
    ("suffix", "dtype"),
    [
        (".exr", "float32"),
        (".exr", "float16"),
        (".tif", "float32"),
        (".tif", "float64"),
        (".tif", "uint8"),
        (".tiff", "uint16"),
    ],
)
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_round_trip(tmp_path, suffix, dtype, options):
    array = DENSITIES.astype(dtype)
    path = tmp_path / f"v{suffix}"
    write_slices(path, array, options)
    volume = read_volume(path)
    assert volume.densities.dtype == array.dtype
    assert np.array_equal(volume.densities, array)
    assert volume.to_world.tolist() == np.eye(3, 4).tolist()


def test_a_single_image_is_a_single_slice(tmp_path):
    write_slices(tmp_path / "v.exr", DENSITIES[:1].astype(np.float32))
    assert read_volume(tmp_path / "v.exr").densities.shape == (1, 6, 7)


@pytest.mark.parametrize(
    ("attribute", "size"),
    [(("float[3]", (1.0, 2.0, 4.0)), [1.0, 2.0, 4.0]), (("float", 0.5), [0.5] * 3)],
)
def test_an_exr_may_say_how_large_its_voxels_are(tmp_path, attribute, size):
    path = tmp_path / "v.exr"
    write_slices(path, DENSITIES.astype(np.float32), [("freepath:voxel_size", *attribute)])
    medium = build_medium(volume_model(path))
    assert medium.world_box()[-1].tolist() == [7 * size[0], 6 * size[1], 5 * size[2]]
    # the config has the last word
    medium = build_medium(volume_model(path, voxel_size=(3.0, 3.0, 3.0)))
    assert medium.world_box()[-1].tolist() == [21.0, 18.0, 15.0]


@pytest.mark.parametrize(
    "attribute",
    [("float[3]", (1.0, 0.0, 1.0)), ("float[2]", (1.0, 1.0)), ("float", -1.0), ("string", "big")],
)
def test_impossible_voxel_sizes_are_refused(tmp_path, attribute):
    path = tmp_path / "v.exr"
    write_slices(path, DENSITIES.astype(np.float32), [("freepath:voxel_size", *attribute)])
    with pytest.raises(VolumeError, match="freepath:voxel_size: expected one or three positive"):
        read_volume(path)


def test_bad_densities_are_found_in_images_too(tmp_path):
    array = DENSITIES.astype(np.float32)
    array[3, 2, 1] = np.nan
    write_slices(tmp_path / "v.exr", array)
    with pytest.raises(VolumeError, match=r"1 NaN \(first \[z, y, x\] = \[3, 2, 1\]: nan\)"):
        build_medium(volume_model(tmp_path / "v.exr"))


def small(height, width, channels=None):
    return np.ones((height, width) if channels is None else (height, width, channels), np.float32)


REFUSED = {
    "sizes": ("v.tif", [small(2, 3), small(3, 2)], "slice 1 is 2 x 3 float, the first one 3 x 2"),
    "types": ("v.tif", [small(2, 3), small(2, 3).astype(np.uint8)], "slice 1 is 3 x 2 uint8"),
    "channels": ("v.exr", [small(2, 3, 3)], "slice 0 has 3 channels (R, G, B), expected one"),
    "later channels": ("v.tif", [small(2, 3), small(2, 3, 4)], "slice 1 has 4 channels"),
    "format": ("v.png", [small(2, 3).astype(np.uint8)], "expected .npy, EXR, TIFF or OpenVDB, got"),
}


@pytest.mark.parametrize(("name", "slices", "message"), REFUSED.values(), ids=REFUSED)
def test_images_that_are_no_volumes_are_refused(tmp_path, name, slices, message):
    path = tmp_path / name
    write_slices(path, slices)
    with pytest.raises(VolumeError) as error:
        read_volume(path)
    assert str(error.value).startswith(f"{path}: {message}")


@pytest.mark.parametrize("name", ["v.exr", "v.tif", "v.txt", "v"])
def test_what_is_no_image_is_refused(tmp_path, name):
    path = tmp_path / name
    path.write_text("this is not an image")
    with pytest.raises(VolumeError, match=f"{name}: is not an image: ") as error:
        read_volume(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("suffix", [".exr", ".tif"])
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_a_file_that_is_cut_anywhere_is_refused(tmp_path, suffix, options):
    whole = tmp_path / f"whole{suffix}"
    write_slices(whole, DENSITIES.astype(np.float32), options)
    content = whole.read_bytes()
    path = tmp_path / f"v{suffix}"
    for size in [*range(1, len(content), 23), len(content) - 1]:
        path.write_bytes(content[:size])
        with pytest.raises(VolumeError, match="is not an image|is truncated|cannot be read"):
            read_volume(path)


def test_extinction_of_images(tmp_path):
    write_slices(tmp_path / "v.tif", DENSITIES.astype(np.uint8))
    volume = read_volume(tmp_path / "v.tif")
    found = extinction(volume.densities, 0.5, "v")
    assert found.tolist() == (DENSITIES.astype(np.uint8) * 0.5).tolist()
