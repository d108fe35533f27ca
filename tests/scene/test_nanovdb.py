"""NanoVDB: files by a writer of the tests, whose format NanoVDB's own reader was held against."""

import struct
import tracemalloc

import numpy as np
import pytest

from freepath.errors import VolumeError
from freepath.scene.volumes.reading import read_volume
from scene.nanovdb_files import CODES, NUMBERS, grid, looked_up, segment, written

RNG = np.random.default_rng(4)
FIRST = (-5, 4090, 120)
VALUES = (RNG.integers(1, 99, (14, 9, 17)) * (RNG.random((14, 9, 17)) < 0.6)).astype(float)
VALUES[5:13] = 7
"""A corner of four upper nodes lies in it, and at x = 0 a leaf is one value."""
WIDTHS = {"Fp4": 15, "Fp8": 255, "Fp16": 65535}


@pytest.mark.parametrize("kind", NUMBERS)
@pytest.mark.parametrize("codec", [0, 1, 2])
def test_every_type_in_every_packing(tmp_path, kind, codec):
    written(tmp_path / "v.nvdb", VALUES, kind, first=FIRST, codec=codec)
    volume = read_volume(tmp_path / "v.nvdb")
    if NUMBERS[kind] in CODES:
        assert volume.densities.T.tolist() == VALUES.tolist()
    else:
        step = 98 / WIDTHS.get(kind, 255)
        assert np.abs(volume.densities.T - VALUES).max() <= 0.5001 * step
    if codec < 2:
        assert volume.densities.tolist() == looked_up(tmp_path / "v.nvdb").tolist()
    told = f"grid density of {kind}, active box [-5, 4090, 120] to [8, 4098, 136] [x, y, z], "
    assert volume.told == f"{tmp_path / 'v.nvdb'}: {told}background 0"


@pytest.mark.parametrize("bits", [1, 2, 4, 8, 16])
def test_every_width_of_variable_bits(tmp_path, bits):
    values = RNG.integers(0, 2, (8, 8, 8)) * 3.0
    written(tmp_path / "v.nvdb", values, "FpN", bits=bits)
    densities = read_volume(tmp_path / "v.nvdb").densities
    assert np.abs(densities.T - values).max() < 1e-6
    assert np.array_equal(densities, looked_up(tmp_path / "v.nvdb"))


def test_tiles_of_all_levels(tmp_path):
    values = np.zeros((140, 136, 130), np.float32)
    values[:128, :128, :128] = 2  # one entry of an upper node
    values[129:, 100:, :] = 3  # entries of lower nodes, and leaves
    values[139, 135, 129] = 4
    written(tmp_path / "v.nvdb", values, first=(0, 0, -128), codec=1)
    assert np.array_equal(read_volume(tmp_path / "v.nvdb").densities.T, values)


def test_the_transform_takes_middles_of_voxels(tmp_path):
    to_world = np.array([[0.5, 0.1, 0, 1], [0, 2, -0.25, 2], [0, 0, 3, 3]])
    written(tmp_path / "v.nvdb", VALUES, first=FIRST, to_world=to_world)
    volume = read_volume(tmp_path / "v.nvdb")
    assert volume.first == FIRST[::-1]
    middle = volume.to_world @ [0.5, 0.5, 0.5, 1]
    assert middle == pytest.approx(to_world @ [*FIRST, 1], rel=1e-14)
    assert volume.to_world[:, :3].tolist() == to_world[:, :3].tolist()


def test_grids_are_chosen_by_name(tmp_path):
    one, two = (grid(np.full((2, 2, 2), value)) for value in (1.0, 2.0))
    path = tmp_path / "v.nvdb"
    path.write_bytes(segment([one, two]) + segment([one], name="heat", codec=1))
    assert read_volume(path, "density[1]").densities.max() == 2
    assert read_volume(path, "heat").densities.max() == 1
    assert read_volume(path, "heat").others == ("density", "density[1]")
    with pytest.raises(VolumeError, match="it holds several grids, choose one of: density, d"):
        read_volume(path)
    with pytest.raises(VolumeError, match="there is no grid 'x' of scalars, expected one of"):
        read_volume(path, "x")


SMALL = np.arange(24.0).reshape(2, 3, 4)


def changed(at, form, *numbers, **options):
    """A file with some bytes of its grid's memory changed."""
    memory, *rest = grid(SMALL)
    at += len(memory) if at < 0 else 0
    size = struct.calcsize(form)
    memory = memory[:at] + struct.pack(form, *numbers) + memory[at + size :]
    return segment([(memory, *rest)], **options)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"NanoVDB", "is damaged, or no NanoVDB file: unpack"),
        (b"this is no volume at all", "expected a segment that begins with NanoVDB, got b'this is"),
        (segment([grid(SMALL)], abi=31), "format version 31, expected 32"),
        (segment([grid(SMALL)])[:-1], "it is truncated, its grids go on beyond its end"),
        (segment([grid(SMALL)])[:196], "it ends in the name of a grid"),
        (segment([grid(SMALL)], grid_class=1), "grid density is a level set, which holds"),
        (segment([grid(SMALL, background=0.5)]), "its background is 0.5: outside of its active"),
        (segment([(b"", 6, [0] * 3, [1] * 3)]), "it holds no grid of scalars: density .of vec3f"),
        (segment([(b"", 26, [0] * 3, [1] * 3)]), "it holds no grid of scalars: density .of type"),
        (segment([grid(SMALL)], codec=3), "codec 3, expected 0 .none., 1 .zip. or 2 .blosc."),
        (changed(0, "<8s", b"Nanotube"), "expected a grid that begins with NanoVDB, got b'Nano"),
        (changed(636, "<I", 4), "its grid is of type 4, and said to be of float"),
        (changed(736, "<6i", *[0] * 3, *[-1] * 3), "the grid is empty: it has no active voxels"),
        (changed(736, "<6i", *[0] * 3, *[1 << 30] * 3), "voxels, expected at most 2147483647"),
        (changed(736, "<6i", *[0] * 3, *[900] * 3), "is damaged, or nearly empty: it claims"),
        (changed(696, "<Q", 1 << 62), "an offset leads out of its grid"),
        (changed(808, "<q", 1 << 40), "an offset leads out of its grid"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_refused(tmp_path, content, told):
    (tmp_path / "v.nvdb").write_bytes(content)
    with pytest.raises(VolumeError, match=told) as error:
        read_volume(tmp_path / "v.nvdb")
    assert str(error.value).startswith(f"{tmp_path / 'v.nvdb'}: ")


def test_nodes_that_overlap_are_refused(tmp_path):
    """Two tiles of the root for one place: which counts would be a matter of order."""
    memory, *rest = grid(SMALL)
    tile = memory[800:832]
    (offset,) = struct.unpack_from("<q", tile, 8)
    doubled = (tile[:8] + struct.pack("<q", offset + 32) + tile[16:]) * 2
    memory = memory[:760] + struct.pack("<I", 2) + memory[764:800] + doubled + memory[832:]
    (tmp_path / "v.nvdb").write_bytes(segment([(memory, *rest)]))
    with pytest.raises(VolumeError, match="is damaged, .*: its nodes overlap"):
        read_volume(tmp_path / "v.nvdb")


def test_what_zip_claims_is_not_believed(tmp_path):
    content = bytearray(segment([grid(SMALL)], codec=1))
    for claimed, told in ((1 << 50, "voxels, expected at most"), (1 << 32, "it claims 4 GiB in a")):
        content[16:24] = struct.pack("<Q", claimed)
        (tmp_path / "v.nvdb").write_bytes(content)
        with pytest.raises(VolumeError, match=told):
            read_volume(tmp_path / "v.nvdb")


def test_a_zip_stream_is_read_to_its_checksum(tmp_path):
    content = segment([grid(SMALL)], codec=1)
    for wrong in (content[:-1] + bytes([content[-1] ^ 1]), content.replace(b"x\x9c", b"x\x9d", 1)):
        (tmp_path / "v.nvdb").write_bytes(wrong)
        with pytest.raises(VolumeError, match="is damaged, .*: Error -3 while decompressing"):
            read_volume(tmp_path / "v.nvdb")


def test_what_a_name_claims_is_not_allocated(tmp_path):
    content = bytearray(segment([grid(SMALL)]))
    content[16 + 136 : 16 + 140] = struct.pack("<I", 2**32 - 1)
    (tmp_path / "v.nvdb").write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(VolumeError, match="it ends in the name of a grid"):
            read_volume(tmp_path / "v.nvdb")
        assert tracemalloc.get_traced_memory()[1] < 1 << 27
    finally:
        tracemalloc.stop()
