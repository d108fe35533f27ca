"""Images of an environment: their table, and refusing what is no radiance."""

import numpy as np
import OpenImageIO as oiio
import pytest

from freepath import cli
from freepath.compose.light_paths import SKY_COLUMNS, SKY_ROWS
from freepath.config.lights import Image
from freepath.errors import VolumeError
from freepath.results.folder import read_rows
from freepath.scene import read_sky

CONFIG = """\
name: sky
rays: {orthographic: {resolution: 4, direction: [0, 1, 0]}}
matrix:
  estimand: radiance
  medium: {homogeneous: {sigma_t: 1}}
  light: {image: {file: sky.exr}}
  tracker: delta
stop: {samples: 20}
"""


def write(path, pixels, kind=oiio.FLOAT):
    image = oiio.ImageBuf(np.ascontiguousarray(pixels, dtype=np.float32))
    assert image.write(str(path), kind), image.geterror()
    return Image(file=str(path))


def test_means_of_blocks(tmp_path):
    pixels = np.random.default_rng(1).random((SKY_ROWS * 2, SKY_COLUMNS * 4, 3), np.float32)
    sky = read_sky(write(tmp_path / "a.exr", pixels), 3)
    means = pixels.reshape(SKY_ROWS, 2, SKY_COLUMNS, 4, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(sky.table[:, 1:-1], np.moveaxis(means, 2, 0), rtol=1e-5)
    grey = read_sky(write(tmp_path / "b.exr", pixels), 1)
    np.testing.assert_allclose(grey.table[0], sky.table.mean(axis=0), rtol=1e-4, atol=1e-5)


def test_a_grey_image_in_colours(tmp_path):
    sky = read_sky(write(tmp_path / "a.exr", np.full((3, 5, 1), 2.0)), 3)
    assert sky.table.shape == (3, SKY_ROWS + 2, SKY_COLUMNS)
    np.testing.assert_array_equal(sky.radiance(np.eye(3)), np.full((3, 3), 2.0))


def test_alpha_is_left_out(tmp_path):
    pixels = np.concatenate([np.full((2, 2, 3), 3.0), np.zeros((2, 2, 1))], axis=2)
    assert (read_sky(write(tmp_path / "a.exr", pixels), 1).table == 3).all()


def test_no_direction_is_darker_than_the_darkest_pixel(tmp_path):
    pixels = np.random.default_rng(2).random((64, 128, 1), np.float32) ** 8
    sky = read_sky(write(tmp_path / "a.exr", pixels), 1)
    directions = np.random.default_rng(3).normal(size=(100_000, 3))
    directions[:1000, :2] *= 1e-3
    found = sky.radiance(directions)
    assert found.min() >= pixels.min() - 1e-7
    assert found.max() <= pixels.max() + 1e-7


def test_poles_without_a_longitude(tmp_path):
    pixels = np.random.default_rng(2).random((64, 128, 1), np.float32)
    sky = read_sky(write(tmp_path / "a.exr", pixels), 1)
    poles = np.array([[0, 0, 1], [-0.0, -0.0, 1], [0, 0, -1.0]])
    expected = pixels[[0, 0, -1]].mean(axis=1)
    np.testing.assert_allclose(sky.radiance(poles), expected, rtol=1e-5)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.nan, r"1 NaN \(first \[row, column, channel\] = \[1, 2, 0\]: nan\)"),
        (np.inf, "1 infinite"),
        (-0.5, r"1 negative .*: -0\.5\)"),
    ],
)
def test_what_is_no_radiance(tmp_path, value, message):
    pixels = np.ones((4, 8, 3))
    pixels[1, 2, 0] = value
    with pytest.raises(VolumeError, match=message):
        read_sky(write(tmp_path / "a.exr", pixels), 3)


def test_other_channels(tmp_path):
    with pytest.raises(VolumeError, match="has 3 channels, expected 1 or 2"):
        read_sky(write(tmp_path / "a.exr", np.ones((4, 8, 3))), 2)


def test_integers(tmp_path):
    with pytest.raises(VolumeError, match="floating-point numbers .*, got uint8"):
        read_sky(write(tmp_path / "a.png", np.ones((4, 8, 3)), oiio.UINT8), 3)


def test_too_bright_for_float32(tmp_path):
    light = Image(file=write(tmp_path / "a.exr", np.full((2, 2, 1), 1e30)).file, scale=1e20)
    with pytest.raises(VolumeError, match="too large for float32 once multiplied by 1e\\+20"):
        read_sky(light, 1)


def test_no_image_and_half_of_one(tmp_path):
    (tmp_path / "a.exr").write_text("no image")
    with pytest.raises(VolumeError, match="is not an image"):
        read_sky(Image(file=str(tmp_path / "a.exr")), 1)
    light = write(tmp_path / "b.exr", np.random.default_rng(1).random((64, 64, 3)))
    whole = (tmp_path / "b.exr").read_bytes()
    (tmp_path / "b.exr").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(VolumeError, match="b.exr"):
        read_sky(light, 3)


def test_a_missing_image_is_told_before_anything_runs(work, selector, capsys):
    (work / "sky.yaml").write_text(CONFIG)
    assert cli.main(["run", "sky.yaml", "-d", selector, "-o", "out"]) == 2
    assert "sky.exr: no such file in" in capsys.readouterr().err
    assert not (work / "out").exists()


def test_another_image_of_the_same_name_is_another_run(work, selector, capsys):
    (work / "sky.yaml").write_text(CONFIG)
    found = []
    for value in (1.0, 2.0):
        write(work / "sky.exr", np.full((2, 4, 1), value))
        resume = ["--resume"] if found else []
        assert cli.main(["run", "sky.yaml", "-d", selector, "-o", "out", *resume]) == 0
        found += read_rows(work / "out" / "summary.csv")
    first, second = found
    assert first["config_sha256"] != second["config_sha256"]
    assert first["light"] == "image-sky.exr"
    assert float(second["reference"]) == pytest.approx(2 * np.exp(-1))
    assert (first["status"], second["status"]) == ("ok", "ok")


def test_nothing_shines(work, selector, capsys):
    """Without any light single scattering has no point to look for."""
    text = CONFIG.replace("light: {image: {file: sky.exr}}", "light: dark\n  scatterings: 1")
    (work / "sky.yaml").write_text(text.replace("sigma_t: 1", "sigma_t: 1, albedo: 0.5"))
    assert cli.main(["run", "sky.yaml", "-d", selector, "-o", "out"]) == 0
    (row,) = read_rows(work / "out" / "summary.csv")
    assert float(row["estimate"]) == float(row["reference"]) == 0


def sky_of(path, pixels, names, window=(0, 0), shown=None):
    """Write an EXR with these channels, a data window at (y, x) and a display window (h, w)."""
    height, width = pixels.shape[:2]
    spec = oiio.ImageSpec(width, height, len(names), "float")
    spec.channelnames = names
    spec.y, spec.x = window
    spec.full_height, spec.full_width = shown or (height, width)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    assert output.write_image(pixels.astype(np.float32))
    assert output.close()
    return Image(file=str(path))


@pytest.mark.parametrize("window", [(0, 0), (3, 5), (-2, -3), (6, 14), (9, 20)])
def test_a_sky_is_the_picture_of_its_display_window(tmp_path, window):
    pixels = np.random.default_rng(4).random((4, 8, 3))
    whole = np.zeros((8, 16, 3))
    for row, column in np.ndindex(4, 8):
        y, x = row + window[0], column + window[1]
        if 0 <= y < 8 and 0 <= x < 16:
            whole[y, x] = pixels[row, column]
    expected = read_sky(write(tmp_path / "whole.exr", whole), 3)
    found = read_sky(sky_of(tmp_path / "a.exr", pixels, ("R", "G", "B"), window, (8, 16)), 3)
    np.testing.assert_array_equal(found.table, expected.table)


@pytest.mark.parametrize(
    ("names", "used", "left"),
    [
        (("R", "G", "B", "Z"), "R, G, B", "Z"),
        (("R", "G", "B", "A", "mask"), "R, G, B", "mask"),
        (("R", "G", "B", "diffuse.R", "diffuse.G", "diffuse.B"), "R, G, B", "diffuse.R, "),
        (("Y", "Z"), "Y", "Z"),
        (("beauty.R", "beauty.G", "beauty.B", "depth.Z"), "beauty.R, beauty.G, beauty.B", "dep"),
    ],
)
def test_channels_beside_colours_are_no_radiance(tmp_path, names, used, left):
    pixels = np.full((4, 8, len(names)), 1000.0)
    count = len(used.split(", "))
    light = sky_of(tmp_path / "a.exr", pixels, names)
    told = read_sky(light, 1).told
    order = [names.index(name) for name in used.split(", ")]
    pixels[..., order] = np.linspace(0.25, 0.75, count)
    sky = read_sky(sky_of(tmp_path / "a.exr", pixels, names), 1)
    np.testing.assert_allclose(sky.table, np.linspace(0.25, 0.75, count).mean(), rtol=1e-6)
    assert told == sky.told
    assert told.startswith(f"{light.file}: channels {used}; not used: {left}")


def test_what_is_used_of_a_sky_is_told(work, selector, capsys):
    (work / "sky.yaml").write_text(CONFIG)
    sky_of(work / "sky.exr", np.full((2, 4, 4), 0.5), ("R", "G", "B", "Z"))
    assert cli.main(["run", "sky.yaml", "-d", selector, "-o", "out"]) == 0
    told = "sky.exr: channels R, G, B; not used: Z"
    assert told in capsys.readouterr().out
    assert told in (work / "out" / "run.json").read_text()
