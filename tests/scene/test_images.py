import struct

import numpy as np
import pytest
import tifffile

from freepath.errors import VolumeError
from freepath.scene import build_medium
from freepath.scene.volumes.reading import extinction, read_volume
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
    "sizes": ("v.tif", [small(2, 3), small(3, 2)], "slice 1 is 2 x 3 float32"),
    "types": ("v.tif", [small(2, 3), small(2, 3).astype(np.uint8)], "slice 1 is 3 x 2 uint8"),
    "channels": ("v.exr", [small(2, 3, 3)], "slice 0 has 3 channels (R, G, B), expected one"),
    "later channels": ("v.tif", [small(2, 3), small(2, 3, 4)], "slice 1 has 4 channels"),
    "format": ("v.png", [small(2, 3).astype(np.uint8)], "expected .npy, EXR, TIFF, OpenVDB"),
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


def exr(path, parts):
    """Write parts of one channel at offsets (y, x): [(offset, pixels)]."""
    import OpenImageIO as oiio

    specs = []
    for number, ((y, x), pixels) in enumerate(parts):
        spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 1, "float")
        spec.x, spec.y, spec.full_width, spec.full_height = x, y, 20, 20
        spec.attribute("oiio:subimagename", f"part {number}")
        specs.append(spec)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), tuple(specs)), output.geterror()
    for number, (_, pixels) in enumerate(parts):
        if number:
            assert output.open(str(path), specs[number], "AppendSubimage")
        assert output.write_image(pixels.astype(np.float32)[..., None])
    assert output.close()


def test_parts_of_an_exr_lie_where_their_data_windows_say(tmp_path):
    parts = [((3, 2), RNG.random((2, 5))), ((4, -1), RNG.random((4, 3))), ((5, 2), np.ones((1, 1)))]
    exr(tmp_path / "v.exr", parts)
    expected = np.zeros((3, 5, 8), np.float32)
    for z, ((y, x), pixels) in enumerate(parts):
        for row, column in np.ndindex(pixels.shape):
            expected[z, y + row - 3, x + column + 1] = pixels[row, column]
    assert read_volume(tmp_path / "v.exr").densities.tolist() == expected.tolist()


def test_windows_far_apart_claim_no_memory(tmp_path):
    exr(tmp_path / "v.exr", [((0, 0), np.ones((1, 1))), ((30_000, 30_000), np.ones((1, 1)))])
    with pytest.raises(VolumeError, match="is damaged, or nearly empty: it claims 6.71 GiB in a"):
        read_volume(tmp_path / "v.exr")


def test_a_header_that_is_no_text(tmp_path):
    path = tmp_path / "v.exr"
    write_slices(path, DENSITIES.astype(np.float32))
    content = path.read_bytes()
    told = []
    for place in range(8, 300):
        path.write_bytes(content[:place] + bytes([content[place] | 0x80]) + content[place + 1 :])
        try:
            read_volume(path)
        except VolumeError as error:
            told.append(str(error))
    assert f"{path}: is damaged, its header has text that is no UTF-8" in told


def tiff(path, pages, bits, photometric=1, description=b"", order="<", **more):
    """Write pages of integers, packed by hand: TIFF 6.0, sections 2 and 3, without compression."""
    data = b""
    last = 4
    data += {"<": b"II", ">": b"MM"}[order] + struct.pack(f"{order}HI", 42, 0)
    for page in pages:
        height, width = page.shape
        rows = b""
        for row in page.tolist():
            text = "".join(format(value, f"0{bits}b") for value in row)
            packed = int(text + "0" * (-len(text) % 8), 2).to_bytes(-(-len(text) // 8), "big")
            if bits == 16 and order == "<":
                packed = np.frombuffer(packed, ">u2").astype("<u2").tobytes()
            rows += packed
        entries = {256: width, 257: height, 258: bits, 259: 1, 262: photometric, 273: len(data)}
        entries |= {277: 1, 278: height, 279: len(rows)} | more.get("entries", {})
        data += rows + more.get("behind", b"")
        if description:
            entries[270] = (len(data), len(description) + 1)
            data += description + b"\0"
        data += b"\0" * (len(data) % 2)
        data = data[:last] + struct.pack(f"{order}I", len(data)) + data[last + 4 :]
        data += struct.pack(f"{order}H", len(entries))
        for tag, value in sorted(entries.items()):
            place, count = value if tag == 270 else (value, 1)
            data += struct.pack(f"{order}HHII", tag, 2 if tag == 270 else 4, count, place)
        last = len(data)
        data += struct.pack(f"{order}I", 0)
    path.write_bytes(data)


@pytest.mark.parametrize("bits", [1, 2, 4, 6, 8, 10, 12, 14, 16])
@pytest.mark.parametrize(("photometric", "order"), [(0, "<"), (0, ">"), (1, "<"), (1, ">")])
def test_densities_are_the_numbers_of_a_tiff_file(tmp_path, bits, photometric, order):
    pages = RNG.integers(0, 2**bits, (3, 5, 7))
    pages[0, 0, :2] = 0, 2**bits - 1
    tiff(tmp_path / "v.tif", pages, bits, photometric, order=order)
    assert read_volume(tmp_path / "v.tif").densities.astype(int).tolist() == pages.tolist()


def test_a_stack_behind_one_directory_is_read_whole(tmp_path):
    stack = RNG.integers(0, 4096, (3, 4, 8))
    description = b"ImageJ=1.53t\nimages=3\nslices=3\nloop=false\n"
    behind = stack[1:].astype("<u2").tobytes()
    tiff(tmp_path / "v.tif", stack[:1], 16, description=description, behind=behind)
    assert read_volume(tmp_path / "v.tif").densities.tolist() == stack.tolist()


PROMISES = {
    "ImageJ": (b"ImageJ=1.53t\nimages=5\nslices=5\n", "promises 5 slices, 2 are there"),
    "ImageJ's channels": (b"ImageJ=1.53t\nimages=2\nchannels=2\n", "promises 2 channels"),
    "OME": (b'<OME><Pixels SizeZ="4" SizeC="1" SizeT="2"/></OME>', "promises 8 slices, 2 are"),
    "OME's channels": (
        b'<OME><Pixels SizeZ="1" SizeC="2" SizeT="1"/></OME>',
        "promises 2 channels, expected",
    ),
    "tifffile": (b'{"shape": [3, 4, 8]}', "promises 3 slices, 2 are there"),
}


@pytest.mark.parametrize(("description", "message"), PROMISES.values(), ids=PROMISES)
def test_fewer_slices_than_promised(tmp_path, description, message):
    tiff(tmp_path / "v.tif", np.ones((2, 4, 8), int), 8, description=description)
    with pytest.raises(VolumeError, match=f"its description {message}"):
        read_volume(tmp_path / "v.tif")


def test_one_slice_of_which_three_are_promised(tmp_path):
    tiff(tmp_path / "v.tif", np.ones((1, 4, 8), int), 8, description=b"ImageJ=1\nimages=3\n")
    with pytest.raises(VolumeError, match="promises 3 slices, 1 are there"):
        read_volume(tmp_path / "v.tif")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"photometric": 3, "entries": {320: 8}}, r"has 1 channels \(PALETTE\), expected 1"),
        ({"entries": {339: 6}, "bits": 16}, "bits of format"),
        ({"entries": {256: 2**31, 257: 2**31}}, "expected at most 2147483647"),
        ({"entries": {256: 20_000, 257: 20_000}}, "is damaged, or nearly empty: it claims"),
        ({"entries": {273: 10**9}}, "cannot be read"),
    ],
)
def test_damaged_tiff_files(tmp_path, change, message):
    tiff(tmp_path / "v.tif", np.ones((1, 4, 8), int), **({"bits": 8} | change))
    with pytest.raises(VolumeError, match=message):
        read_volume(tmp_path / "v.tif")


def test_a_tag_that_cannot_be_read_is_not_left_out(tmp_path, capsys):
    path = tmp_path / "v.tif"
    tiff(path, np.ones((2, 4, 8), int), 8)
    content = path.read_bytes()
    tag = struct.pack("<HHI", 258, 4, 1)  # of 8 bits; without it there would be 1
    path.write_bytes(content.replace(tag, struct.pack("<HHI", 258, 4, 2**20)))
    with pytest.raises(VolumeError, match="cannot be read: .*TiffTag 258 .* invalid value offset"):
        read_volume(path)
    assert capsys.readouterr().err == ""


def test_pages_in_a_circle(tmp_path):
    path = tmp_path / "v.tif"
    tiff(path, np.ones((2, 4, 8), int), 8)
    content = path.read_bytes()
    path.write_bytes(content[:-4] + content[4:8])
    with pytest.raises(VolumeError, match="its pages go round in a circle"):
        read_volume(path)


@pytest.mark.parametrize("compression", ["lzw", "zlib", "packbits", "zstd", "lzma"])
def test_compressions(tmp_path, compression):
    array = (DENSITIES * 100).astype(np.uint16)
    tifffile.imwrite(tmp_path / "v.tif", array, compression=compression, predictor=False)
    assert np.array_equal(read_volume(tmp_path / "v.tif").densities, array)
