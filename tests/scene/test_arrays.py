"""Raw numbers, Mitsuba's .vol and pbrt's text: bytes written here after the formats' pages."""

import struct

import numpy as np
import pytest

from freepath.errors import VolumeError
from freepath.scene import build_medium
from freepath.scene.volumes.reading import read_volume
from scene.helpers import volume_model

DENSITIES = np.arange(24.0).reshape(2, 3, 4) + 0.5
BOX = (-1.0, 2.0, 0.0, 1.0, 5.0, 8.0)
PBRT = """\
# a comment with MakeNamedMedium "other"
MakeNamedMedium "smoke" "string type" "uniformgrid"
  "spectrum sigma_a" [ 200 1 900 1 ] "float scale" 3  # density follows
  "integer nx" [ 4 ] "integer ny" 3 "integer nz" [2]
  "point3 p0" [ -1 2 0 ] "point3 p1" [1 5 8]
  "float density" [
    {numbers}
  ]
AttributeBegin
Translate 1 0 0
MakeNamedMaterial "density" "string type" "diffuse" "float density" [ 1 ]
"""


def vol(densities=DENSITIES, kind=1, channels=1, box=BOX, version=3):
    nz, ny, nx = densities.shape
    head = struct.pack("<3sB5i6f", b"VOL", version, kind, nx, ny, nz, channels, *box)
    return head + densities.astype("<f4" if kind == 1 else "u1").tobytes()


def pbrt(change=("", "")):
    numbers = " ".join(f"{value:g}" for value in DENSITIES.ravel())
    return PBRT.replace("{numbers}", numbers).replace(*change).encode()


def written(path, content):
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("kind", ["uint8", "int16", "uint32", "int64", "float16", "float64"])
@pytest.mark.parametrize("order", ["little", "big"])
def test_raw(tmp_path, kind, order):
    numbers = DENSITIES.astype(kind).astype(np.dtype(kind).newbyteorder(order[0]))
    path = written(tmp_path / "v.bin", numbers.tobytes())
    raw = f"4x3x2 {kind}" + ("" if kind == "uint8" else f" {order}")
    medium = build_medium(volume_model(path, raw=raw))
    assert medium.voxels.tolist() == DENSITIES.astype(kind).tolist()
    other = {"little": "big", "big": "little"}[order]
    if kind != "uint8":
        swapped = read_volume(path, raw=f"4x3x2 {kind} {other}").densities
        assert swapped.tolist() != DENSITIES.astype(kind).tolist()


def test_raw_numbers_are_as_many_as_is_said(tmp_path):
    path = written(tmp_path / "v.raw", bytes(48))
    with pytest.raises(VolumeError, match="4x3x2 uint8 takes 24 bytes, the file has 48"):
        read_volume(path, raw="4x3x2 uint8")
    with pytest.raises(VolumeError, match="4x3x2 float32 big takes 96 bytes, the file has 48"):
        read_volume(path, raw="4x3x2 float32 big")


@pytest.mark.parametrize(("kind", "values"), [(1, DENSITIES), (3, DENSITIES // 1)])
def test_vol(tmp_path, kind, values):
    volume = read_volume(written(tmp_path / "v.vol", vol(kind=kind)))
    assert volume.densities.tolist() == values.tolist()
    for place, corner in (((0, 0, 0), BOX[:3]), ((4, 3, 2), BOX[3:])):
        assert (volume.to_world @ [*place, 1]).tolist() == list(corner)
    longer = read_volume(written(tmp_path / "v.vol", vol(kind=kind) + b"rest"))
    assert longer.told.endswith("; 4 bytes behind its voxels are not used")


def test_a_vol_that_mitsuba_wrote(tmp_path):
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    mitsuba.VolumeGrid(DENSITIES[..., None].astype(np.float32)).write(str(tmp_path / "m.vol"))
    assert (tmp_path / "m.vol").read_bytes() == vol(box=(0, 0, 0, 1, 1, 1))


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"VOL\3", "expected a volume of Mitsuba, format version 3"),
        (vol(version=4), "expected a volume of Mitsuba, format version 3"),
        (vol(channels=3), "type 1 in 3 channels, expected float32"),
        (vol(kind=2), "type 2 in 1 channels, expected float32"),
        (vol()[:-1], "is truncated, 1 bytes of its array are missing"),
        (vol(np.zeros((2, 0, 4))), "0 voxels, expected 1 to"),
        (vol(box=(0, 0, 0, 1, 0, 1)), "its box is .*, expected a volume"),
        (vol(box=(0, 0, 0, 1, np.nan, 1)), "its box is .*, expected a volume"),
    ],
)
def test_a_vol_that_is_refused(tmp_path, content, told):
    with pytest.raises(VolumeError, match=f"v.vol: {told}"):
        read_volume(written(tmp_path / "v.vol", content))


@pytest.mark.parametrize(
    "change",
    [
        ("", ""),
        ('"uniformgrid"', '[ "heterogeneous" ]'),
        ('"point3 p', '"point p'),
        (" 7.5 ", " 75e-1\n# and so on\n"),
    ],
)
def test_pbrt(tmp_path, change):
    volume = read_volume(written(tmp_path / "v.pbrt", pbrt(change)))
    assert volume.densities.tolist() == DENSITIES.tolist()
    assert volume.told.endswith("; not used: sigma_a, scale")
    for place, corner in (((0, 0, 0), BOX[:3]), ((4, 3, 2), BOX[3:])):
        assert (volume.to_world @ [*place, 1]).tolist() == list(corner)


def test_the_box_of_pbrt_is_a_unit_cube_where_none_is_given(tmp_path):
    content = pbrt(('"point3 p0" [ -1 2 0 ] "point3 p1" [1 5 8]', ""))
    to_world = read_volume(written(tmp_path / "v.pbrt", content)).to_world
    assert to_world.tolist() == np.diag([1 / 4, 1 / 3, 1 / 2, 0])[:3].tolist()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('MakeNamedMedium "smoke"', "", "0 named media, expected one"),
        ("# a comment with", "", "2 named media, expected one"),
        ('"uniformgrid"', '"rgbgrid"', "a medium of type 'rgbgrid', expected"),
        ('"float density"', '"float temperature"', "0 numbers in density, expected 24"),
        ("4 ] ", "5 ] ", "24 numbers in density, expected 30"),
        ("4 ] ", "2.5 ] ", "24 numbers in density, expected more"),
        ("4 ] ", "-4 ] ", "24 numbers in density, expected more"),
        ("4 ] ", "1e999 ] ", "24 numbers in density, expected more"),
        (" 7.5 ", " 7_5 ", "density is no list of numbers"),
        (" 7.5 ", " seven ", "density is no list of numbers"),
        ("5 8]", "5]", "2 numbers in p1, expected 3"),
        ("[1 5 8]", "[1 2 8]", "its box is .*, expected a volume"),
        ("# a comment", "Scale 1 2 3 # a", "Scale before the medium, which is not followed"),
        (" 7.5 ", " \xb5\xff ", "is no text: 'utf-8' codec"),
    ],
    ids=str,
)
def test_pbrt_that_is_refused(tmp_path, old, new, told):
    path = tmp_path / "v.pbrt"
    path.write_bytes(pbrt().decode().replace(old, new).encode("latin1"))
    with pytest.raises(VolumeError, match=f"v.pbrt: {told}"):
        read_volume(path)
