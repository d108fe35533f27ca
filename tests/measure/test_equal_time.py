"""Pictures at equal time: what a run leaves, and what a report makes of it."""

import base64
import html
from pathlib import Path

import numpy as np
import pytest

from freepath import cli
from freepath.measure import equal_time, pictures
from freepath.results.folder import read_rows
from freepath.show.report import load
from freepath.show.report.renders import Render, panels, reference_of, rmse_of

pytestmark = pytest.mark.slow

CONFIG = """\
name: pictures
render: true
rays: {orthographic: {resolution: [16, 8], direction: [0, 0, 1]}}
matrix:
  estimand: radiance
  medium: {cloud: {resolution: 16, sigma_t: 8, albedo: 0.9}}
  light: {point: {position: [0.3, 0.4, 2], intensity: 10}}
  scatterings: [1, 2]
  tracker: delta
  shadow: [ratio, delta]
stop: {samples: 2000}
"""


@pytest.fixture
def result(work, selector):
    (work / "x.yaml").write_text(CONFIG)
    assert cli.main(["run", "x.yaml", "-d", selector, "-o", "out"]) == 0
    return work / "out"


def test_a_run_leaves_pictures_whose_noise_is_that_of_their_time(result):
    rows = read_rows(result / "summary.csv")
    assert len(rows) == 4
    for row in rows:
        paths = [
            result / f / f"{pictures.stem(row)}.exr" for f in ("pictures/equal-time", "pictures")
        ]
        told, short = pictures.read_exr(paths[0])
        _, long = pictures.read_exr(paths[1])
        samples = int(told["freepath:samples"])
        wanted = float(told["freepath:equal_time_s"]) / float(row["time_per_sample_s"])
        assert samples == pytest.approx(wanted, rel=0.3, abs=2)
        # independent samples: errors of pixels over their standard deviation have variance 1
        lit = short["variance"] > 0
        z = (short["mean"] - long["mean"])[lit]
        z = z / np.sqrt(short["variance"] + long["variance"])[lit]
        assert z.size > 60
        assert abs((z**2).mean() - 1) < 6 * np.sqrt((z**2).var() / z.size)


def equal_time_of(folder, row):
    return pictures.read_exr(folder / f"{pictures.stem(row)}.exr")[0]["freepath:equal_time_s"]


@pytest.mark.parametrize("folder", [pictures.FOLDER, pictures.EQUAL_TIME])
def test_a_picture_that_is_gone_is_made_again(result, selector, capsys, folder):
    before = sorted(read_rows(result / "summary.csv"), key=lambda row: row["scatterings"])
    (result / folder / f"{pictures.stem(before[2])}.exr").unlink()
    at_equal_time = result / pictures.EQUAL_TIME
    set_before = equal_time_of(at_equal_time, before[3])

    capsys.readouterr()
    assert cli.main(["run", "x.yaml", "-d", selector, "-o", "out", "--resume"]) == 0
    after = {row["case_id"]: row for row in read_rows(result / "summary.csv")}
    assert len(after) == 4
    again = [row for row in before if row["run_id"] != after[row["case_id"]]["run_id"]]
    assert again == [before[2]]
    # at the time that the others have, however long a sample took this time
    assert {equal_time_of(at_equal_time, row) for row in before[2:]} == {set_before}
    for part in (pictures.FOLDER, pictures.EQUAL_TIME):
        assert (result / part / f"{pictures.stem(before[2])}.exr").is_file()

    capsys.readouterr()
    assert cli.main(["run", "x.yaml", "-d", selector, "-o", "out", "--resume"]) == 0
    assert "nothing was left to run" in capsys.readouterr().out


def test_pictures_that_are_asked_for_later_are_made(work, selector):
    (work / "x.yaml").write_text(CONFIG.replace("render: true", "render: false"))
    run = ["run", "x.yaml", "-d", selector, "-o", "out"]
    assert cli.main(run) == 0
    (work / "x.yaml").write_text(CONFIG)
    assert cli.main([*run, "--resume"]) == 0
    assert len(list(Path("out/pictures/equal-time").glob("*.exr"))) == 4


def test_a_question_is_one_panel_with_errors(result):
    found, left_out = panels(load([result]))
    assert left_out == []
    assert len(found) == 2  # one scattering and two have different answers
    for panel in found:
        assert len(panel["items"]) == 2
        for item in panel["items"]:
            assert "shadow" in item["method"]
            assert 0 < item["rmse"] < 1
            for name in ("picture", "error"):
                head, _, data = item[name].partition(",")
                assert head == "data:image/png;base64"
                assert base64.b64decode(data).startswith(b"\x89PNG")


def rewrite(path, mean, **changes):
    told, _ = pictures.read_exr(path)
    told = {name: text for name, text in told.items() if name.startswith("freepath:")}
    base = path.with_name(path.name.removesuffix(".exr"))
    pictures.write_exr(base, mean, mean, told | changes)


def test_the_worst_picture_comes_last_and_does_not_set_the_scale(result):
    before, _ = panels(load([result]))
    place = result / pictures.EQUAL_TIME
    for row in read_rows(result / "summary.csv"):
        if row["shadow"] == "ratio":
            path = place / f"{pictures.stem(row)}.exr"
            rewrite(path, 1000 * pictures.read_exr(path)[1]["mean"])
    after, _ = panels(load([result]))
    for one, other in zip(before, after, strict=True):
        assert "delta" in other["items"][0]["method"]
        assert other["items"][1]["rmse"] > 100 * other["items"][0]["rmse"]
        assert other["brightest"] < 10 * one["brightest"]


def test_pictures_that_cannot_be_shown_are_named(result, capsys):
    short, long = (sorted((result / f).glob("*.exr")) for f in (pictures.EQUAL_TIME, "pictures"))
    short[0].write_bytes(b"no picture")
    _, parts = pictures.read_exr(short[1])
    rewrite(short[1], parts["mean"], **{"freepath:samples": "many"})
    long[2].unlink()
    found, left_out = panels(load([result]))
    assert sum(len(panel["items"]) for panel in found) == 1
    told = dict(one.split(": ", 1) for one in left_out)
    assert told.keys() == {str(short[0]), str(short[1]), str(long[2])}
    assert "'many'" in told[str(short[1])]
    assert told[str(long[2])] == "there is no such file"

    capsys.readouterr()
    assert cli.main(["report", str(result)]) == 0
    said = capsys.readouterr().err.splitlines()
    assert said == [f"freepath: left out: {one}" for one in left_out]
    page = (result / "report.html").read_text()
    section = page[page.index('id="left-out"') : page.index('id="cases"')]
    assert all(html.escape(one) in section for one in left_out)


def test_pictures_of_another_size_are_named(result):
    _, parts = pictures.read_exr(next((result / pictures.FOLDER).glob("*.exr")))
    for path in (result / pictures.EQUAL_TIME).glob("*.exr"):
        rewrite(path, parts["mean"][:4])
    found, left_out = panels(load([result]))
    assert (len(found), len(left_out)) == (0, 4)
    assert all("its size is 4 x 16 x 1 (height, width, channels)" in one for one in left_out)
    assert all(one.endswith("expected 8 x 16 x 1") for one in left_out)


def row_of(seconds, variance, samples=10_000):
    return {
        "time_per_sample_s": seconds,
        "variance": variance,
        "estimate": 1.0,
        "reference": None,
        "samples_per_ray": samples,
    }


def test_the_time_is_that_of_the_best_and_starts_the_slowest():
    assert equal_time.seconds_of([row_of(1e-6, 1.0), row_of(1e-6, 4.0)]) == pytest.approx(4e-4)
    assert equal_time.seconds_of([row_of(1e-6, 0.0), row_of(1e-3, 1.0)]) == pytest.approx(4e-3)
    # what it was measured in must know it much better
    assert equal_time.seconds_of([row_of(1e-6, 1.0, samples=1000)]) == pytest.approx(1e-4)


def test_the_reference_trusts_the_unbiased_by_their_precision():
    random, shape = np.random.default_rng(1), (64, 64, 1)

    def render(value, variance, *, unbiased):
        long = value + np.sqrt(variance) * random.standard_normal(shape)
        short = value + 0.3 * random.standard_normal(shape)
        return Render({}, Path("x.exr"), short, long, np.full(shape, variance), unbiased, 1, 1.0)

    renders = [
        render(1.0, 0.01, unbiased=True),
        render(1.0, 1.0, unbiased=True),
        render(2.0, 1e-6, unbiased=False),
    ]
    reference, variance = reference_of(renders)
    assert variance == pytest.approx(1 / 101)
    assert reference.mean() == pytest.approx(1.0, abs=0.01)
    # the noise of the reference is no error of the picture
    assert rmse_of(renders[0].mean, reference, variance) == pytest.approx(0.3, rel=0.05)
    assert rmse_of(renders[2].mean, reference, variance) == pytest.approx(1.04, rel=0.05)
