"""Pictures of cases: what a run writes, read back through OpenImageIO."""

import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import OpenImageIO as oiio
import pytest

from freepath import cli
from freepath.errors import FreepathError
from freepath.measure import pictures
from freepath.measure.stats import Moments
from freepath.results.folder import read_rows

pytestmark = pytest.mark.slow

RENDER = """\
name: pictures
render: true
rays: {orthographic: {resolution: [12, 7], direction: [1, 0, 0]}}
matrix:
  medium:
    - linear: {bottom: 0.5, top: 6}
    - homogeneous: {sigma_t: 2, channels: [1, 0.5, 0.2]}
    - homogeneous: {sigma_t: 2, channels: [1, 0.5]}
  tracker: [ratio, spectral_ratio]
stop: {samples: 64}
"""
SEED = (1 << 53) - 1


@pytest.fixture
def go(work, selector, capsys):
    """Run a config; returns its rows that were measured."""

    def go(text=RENDER):
        (work / "pictures.yaml").write_text(text)
        code = cli.main(["run", "pictures.yaml", "-d", selector, "-o", "out"])
        assert (code, capsys.readouterr().err) == (0, "")
        return [row for row in read_rows(Path("out/summary.csv")) if row["status"] == "ok"]

    return go


def read(path):
    """The parts of an image: {name: (channel names, attributes, float pixels)}."""
    image = oiio.ImageInput.open(str(path))
    assert image, oiio.geterror()
    parts = {}
    while image.seek_subimage(len(parts), 0):
        spec, number = image.spec(), len(parts)
        told = {one.name: one.value for one in spec.extra_attribs}
        pixels = image.read_image(number, 0, 0, spec.nchannels, oiio.FLOAT)
        parts[told.get("oiio:subimagename", number)] = (spec.channelnames, told, pixels)
    return parts


def files_of(row):
    base = Path("out") / pictures.FOLDER / pictures.stem(row)
    return base.with_name(base.name + ".exr"), base.with_name(base.name + ".png")


def test_pictures_of_a_run(go):
    rows = go()
    assert {row["channels"] for row in rows} == {"1", "2", "3"}
    names = {"1": ("Y",), "2": ("channel0", "channel1"), "3": ("R", "G", "B")}
    for row in rows:
        exr, png = files_of(row)
        parts = read(exr)
        assert list(parts) == ["mean", "variance"]
        for channels, told, pixels in parts.values():
            assert channels == names[row["channels"]]
            assert pixels.shape == (7, 12, len(channels))
            assert told["freepath:samples"] == "64"
            assert told["freepath:driver"] == row["driver_version"]
            assert told["freepath:schema"] == row["schema_version"]
            for name in ("case", "case_id", "tracker", "medium", "seed", "device"):
                assert told[f"freepath:{name}"] == row[name]
        mean, variance = (parts[name][2].astype(np.float64) for name in ("mean", "variance"))
        assert mean.mean() == pytest.approx(float(row["estimate"]), rel=1e-6)
        assert 64 * variance.mean() == pytest.approx(float(row["variance"]), rel=1e-6)
        assert (variance > 0).all()
        ((_, told, shown),) = read(png).values()
        assert shown.shape == (7, 12, 3)
        assert told["freepath:case"] == row["case"]
        colours = mean if mean.shape[2] == 3 else mean.mean(axis=2, keepdims=True)
        linear = np.clip(colours * float(told["freepath:exposure"]), 0, 1) * np.ones(3)
        np.testing.assert_allclose(shown, encoded(linear), atol=0.6 / 255)
    assert len(list(Path("out/pictures").glob("*.*"))) == 2 * len(rows)


def encoded(linear):
    """The transfer function of sRGB (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def test_pictures_are_upright(go):
    """It is brighter where there is less: the bottom, of a medium that gets denser upward."""
    (row,) = go(f"{RENDER[: RENDER.index('    - homogeneous')]}  tracker: march\n")
    mean = read(files_of(row)[0])["mean"][2][..., 0]
    exact = np.exp(-(0.5 + 5.5 * (1 - (np.arange(7) + 0.5) / 7)))
    np.testing.assert_allclose(mean, exact[:, None] * np.ones(12), rtol=1e-4)


def test_no_picture_unless_asked_for(go):
    go(RENDER.replace("render: true", "render: false"))
    assert not Path("out/pictures").exists()


@pytest.mark.parametrize("rays", ["chords: {count: 84}", "single: {origin: [0, 0, -1]}"])
def test_no_picture_without_a_camera(go, rays):
    rays = rays.replace("}", ", direction: [0, 0, 1]}") if "single" in rays else rays
    cameras = "orthographic: {resolution: [12, 7], direction: [1, 0, 0]}"
    assert go(RENDER.replace(cameras, rays))
    assert not Path("out/pictures").exists()


def test_what_cannot_be_written_loses_no_row(go, work):
    (work / "out").mkdir()
    (work / "out" / "pictures").write_text("a file, where a folder should be")
    rows = go()
    assert len(rows) == 4
    assert {row["reason"].rpartition("; ")[2] for row in rows} == {"no picture: File exists"}
    assert all(row["estimate"] for row in rows)


ROW = dict.fromkeys({*pictures.ATTRIBUTES.values(), *pictures.PLACE}, "x") | {"seed": SEED}
CAMERA = SimpleNamespace(kind="perspective", resolution=(64, 32))


def moments_of(mean):
    return Moments(4, mean, np.ones_like(mean))


@pytest.fixture
def full_disk():
    """Files end at 2 kB."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2048, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_is_told_and_leaves_nothing(tmp_path, full_disk):
    """Half of a picture is not kept, and OpenImageIO's reason is handed on."""
    values = np.random.default_rng(1).random(64 * 32)
    told = pictures.write_pictures(tmp_path, ROW, CAMERA, moments_of(values))
    assert told.startswith("no picture: ")
    assert "write" in told
    assert list((tmp_path / "pictures").iterdir()) == []


def test_a_png_that_was_cut_off_is_noticed(tmp_path, full_disk):
    values = np.random.default_rng(1).random((128, 128, 3))
    with pytest.raises(FreepathError, match="could not be written to its end"):
        pictures.write_mean(tmp_path / "a", values, {})
    assert list(tmp_path.iterdir()) == []


def test_thinned_out_rays_are_no_picture(tmp_path):
    assert pictures.write_pictures(tmp_path, ROW, CAMERA, moments_of(np.ones(16))) == ""
    assert list(tmp_path.iterdir()) == []


def test_a_seed_keeps_all_its_digits(tmp_path):
    pictures.write_pictures(tmp_path, ROW, CAMERA, moments_of(np.ones(64 * 32)))
    (path,) = tmp_path.glob("pictures/*.exr")
    assert read(path)["variance"][1]["freepath:seed"] == str(SEED)


def test_what_is_no_number_shows(tmp_path):
    values = np.linspace(0.1, 2.0, 64 * 32)
    values[[3, 70]] = np.nan, np.inf
    assert pictures.write_pictures(tmp_path, ROW, CAMERA, moments_of(values)) == ""
    exr, png = sorted((tmp_path / "pictures").iterdir())
    mean = read(exr)["mean"][2].ravel()
    np.testing.assert_array_equal(np.flatnonzero(~np.isfinite(mean)), [3, 70])
    shown = read(png)[0][2].reshape(-1, 3)
    marked = np.flatnonzero((shown == pictures.NOT_A_NUMBER).all(axis=1))
    np.testing.assert_array_equal(marked, [3, 70])


@pytest.mark.parametrize("values", [0.0, -1.0, np.nan])
def test_a_picture_without_light(tmp_path, values):
    moments = moments_of(np.full(64 * 32, values))
    assert pictures.write_pictures(tmp_path, ROW, CAMERA, moments) == ""
    assert len(list(tmp_path.glob("pictures/*"))) == 2


def test_names_are_safe_and_apart():
    names = ["a/b", "a_b", "../../a", "a" * 300, "a" * 301, "ü/ö:*?", "a\nb", ".", ""]
    stems = [pictures.stem(ROW | {"case": name, "case_id": name}) for name in names]
    assert len(set(stems)) == len(names)
    for one in stems:
        assert one == os.path.basename(one)
        assert one.isascii()
        assert not one.startswith(".")
        assert len(one) < 200
    others = [pictures.stem(ROW | {column: "y"}) for column in pictures.PLACE]
    assert len({*others, pictures.stem(ROW)}) == len(pictures.PLACE) + 1


def test_white_is_a_percentile():
    mean = np.concatenate([np.zeros(50), np.linspace(1, 100, 100)]).reshape(10, 15, 1)
    shown, exposure = pictures.exposed(mean)
    assert 1 / exposure == pytest.approx(np.percentile(np.linspace(1, 100, 100), 99))
    assert shown.shape == (10, 15, 3)
    assert (shown.min(), shown.max()) == (0, 1)


def test_the_config_wants_a_truth_value(work, selector, capsys):
    (work / "pictures.yaml").write_text(RENDER.replace("render: true", "render: 1"))
    assert cli.main(["run", "pictures.yaml", "-d", selector]) == 2
    assert "render: expected true or false, got 1" in capsys.readouterr().err
