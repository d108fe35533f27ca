"""`freepath recommend`: the soonest case of a volume, and what cannot be asked."""

import re
from pathlib import Path

import numpy as np
import pytest

import freepath
from freepath import config
from freepath.cases import plan
from freepath.cli import main
from freepath.compose import catalog
from freepath.errors import RunError, UsageError
from freepath.extras import recommend
from freepath.extras.given import MARK, own_folder, volume_of
from freepath.extras.recommend import majorants_of, middle_of
from freepath.extras.renderers import RENDERERS
from freepath.results.folder import COLUMNS


@pytest.fixture
def cloud(work):
    """Thin at the borders, empty in a half."""
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, 16)] * 3, indexing="ij")
    np.save(work / "cloud.npy", np.exp(-4 * (x**2 + y**2 + z**2)).astype(np.float32) * (x > 0))
    return "cloud.npy"


@pytest.fixture
def call(work, capsys, selector):
    def call(*arguments):
        try:
            code = main(["recommend", *arguments, "-d", selector])
        except SystemExit as ended:
            code = ended.code
        captured = capsys.readouterr()
        return code, captured.out + captured.err

    return call


def test_named_with_a_config_that_measures_it_again(call, cloud, monkeypatch):
    few = [{"grid": {"resolution": 4}}, {"grid": {"resolution": 8}}]
    monkeypatch.setattr(recommend, "majorants_of", lambda shape: few)
    Path(cloud).rename("~ein Wölkchen \U0001f600.npy")
    cloud = "./~ein Wölkchen \U0001f600.npy"
    options = ["--sigma-t", "0.5", "--budget", "1", "-R", "^(delta|ratio)$", "-o=-2024"]
    code, text = call(cloud, "--accuracy", "5%", *options)
    assert code == 0, text
    (best,) = re.findall(r"fastest: (\S+)", text)
    assert re.search("/(ratio|delta)/", best)
    assert re.search(r"of device time per ray \(95 %: .* to .*\)", text)
    assert re.search(r"second: \S+\n +[\d.]+ .*s, [\d.]+ \([\d.]+ to [\d.]+\) times as long", text)
    left, told = re.search(r"too little: ([\d.]+) s were", text), "not measured: "
    assert left is None or told in text
    assert "optical depth along 1024 rays: mean " in text
    assert "sigma_t is the default" not in text
    assert main(["run", "./-2024/recommended.yaml", "-N"]) == 0
    assert main(["report", "./-2024"]) == 0
    again, text = call(cloud, "--accuracy", "5%", *options)
    assert again == 0, text  # its own folder is made anew


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["none.npy"], 2, "none.npy: no such file in"),
        (["cloud.npy", "--accuracy", "much"], 2, "expected a relative error such as 1%"),
        (["cloud.npy", "--accuracy", "0"], 2, "expected a relative error such as 1%"),
        (["cloud.npy", "--budget", "-1"], 2, "expected a number above 0"),
        (["cloud.npy", "-R", "("], 2, "expected a regular expression"),
        (["cloud.npy", "-R", "none"], 5, "no tracker of transmittance matches 'none'"),
        (["cloud.npy", "--accuracy", "nan"], 2, "expected a relative error such as 1%"),
        (["cloud.npy", "--accuracy=-1%"], 2, "expected a relative error such as 1%"),
        (["cloud.npy", "--budget", "0"], 2, "expected a number above 0"),
        (["cloud.npy", "--sigma-t", "inf"], 2, "expected a number above 0"),
        (["."], 2, "is a folder, expected a file"),
        (["empty.npy"], 2, "empty.npy: is empty: expected a density above 0"),
        (
            ["nan.npy"],
            2,
            "nan.npy: densities that cannot be used: 1 NaN (first [z, y, x] = [2, 3, 4]: nan)",
        ),
        (["flat.npy"], 2, "flat.npy: expected an array of rank 3"),
        (["text.vdb"], 2, "text.vdb: is not an OpenVDB file"),
        (["text.exr"], 2, "text.exr: is not an image"),
        (["cloud.npy", "--grid", "density"], 2, "only OpenVDB and NanoVDB files have named grids"),
    ],
)
def test_what_cannot_be_asked(call, cloud, arguments, code, told):
    odd = np.ones((8, 8, 8), np.float32)
    np.save("empty.npy", 0 * odd)
    np.save("flat.npy", odd[0])
    odd[2, 3, 4] = np.nan
    np.save("nan.npy", odd)
    for name in ("text.vdb", "text.exr"):
        Path(name).write_text("text")
    found, text = call(*arguments)
    assert "Traceback" not in text
    assert (found, told in text) == (code, True), text


def test_majorants_follow_the_voxels():
    shapes = [((126, 86, 154), [16, 11, 20]), ((16, 16, 16), [4, 4, 4])]
    for shape, middle in shapes:
        found = majorants_of(shape)
        assert found[0] == "global"
        assert "octree" in found[-1]
        assert found[middle_of(found)] == {"grid": {"resolution": middle}}
    assert middle_of(majorants_of((1, 1, 1))) == 0


def row_of(name, time, noise="0.01", **changes):
    row = dict.fromkeys(COLUMNS, "") | {"status": "ok", "tracker": name, "majorant": "none"}
    row |= {"case": f"transmittance/m/{name}/auto/strict", "reference": "0.5", "estimate": "0.5"}
    row |= {"time_per_sample_s": str(time / 1e4), "variance": "0.25", "bias_rms": "0"}
    return row | {"time_noise": "0.01", "variance_noise": noise} | changes


def noted(*rows):
    """A search that has seen these rows, one after the other."""
    search = recommend.Search(*[None] * 4, "transmittance", 0.01, 1.0, (), None)
    for row in rows:
        search.note(row, {"tracker": {row["tracker"]: {}}})
    return search


def test_what_is_not_known_pushes_nothing_out():
    """Six cases whose intervals hold 0, and two that are known: these go on first."""
    lucky = [row_of(f"lucky{i}", 1e-6, noise="1.5") for i in range(6)]
    search = noted(*lucky, row_of("march", 3e-4), row_of("ratio", 2e-4))
    assert [one.case.tracker for one in search._few(3)] == ["ratio", "march", "lucky0"]


def test_a_time_that_is_not_known_gets_another_round_and_never_the_last_word():
    """On a busy machine a march was 12 times as fast as the rest, to within 79 %."""
    rough = {"variance": "0", "time_per_sample_s": "1e-6", "time_noise": "0.79"}
    march = row_of("march", 1, noise="0", tracker_label="march", **rough)
    lucky = row_of("lucky", 1e-7, noise="")
    search = noted(march, row_of("ratio", 17e-6, tracker_label="ratio"), lucky)
    assert [one.case.tracker for one in search._few(3)] == ["march", "ratio", "lucky"]
    assert [one.case.tracker for one in search._in_doubt()] == ["march"]
    told = "march takes 1.79 us at most, ratio 17 us; but the former is known to 79 % only"
    with pytest.raises(RunError, match=f"the fastest is not known: {told}"):
        search.finalists()
    search.note(march | {"time_noise": "0.1"}, {"tracker": {"march": {}}})
    assert search.finalists()[0].case.tracker == "march"
    slow = noted(march, row_of("ratio", 1.5e-6))  # of which nobody knows whether it is slower
    assert slow.finalists()[0].case.tracker == "ratio"
    busy = noted(row_of("slow", 1e-3, time_noise="1.5"), row_of("ratio", 1e-5))
    assert [one.case.tracker for one in busy._few(2)] == ["ratio", "slow"]


def test_what_went_wrong_in_a_later_round_never_competes():
    fast = row_of("fast", 1e-5)
    for status in ("mismatch", "invalid", "build_failed", "timeout"):
        search = noted(fast, row_of("slow", 1e-3), fast | {"status": status})
        assert [one.case.tracker for one in search._few(5)] == ["slow"]


def test_the_last_word_is_of_all_rounds():
    """What a first round knew stays known, whatever a later one makes of it or does not ask."""
    first, later = row_of("march", 2e-7), row_of("march", 1e-3, noise="2.0")
    search = noted(first, later, row_of("weighted", 16e-3))
    best, other = search._few(2)
    assert (best.case.tracker, other.case.tracker) == ("march", "weighted")
    assert best.case.time_s == pytest.approx(2e-7, rel=0.01)
    again = noted(first, row_of("march", 3e-7))
    assert again._few(1)[0].case.time_s == pytest.approx(3e-7, rel=0.01)


def test_the_compilers_error_is_told():
    rows = [
        row_of(name, 1, status="build_failed", reason="error: unknown target CPU 'generic'")
        for name in "abc"
    ]
    told = noted()._why_none(rows, Path("out"))
    assert told == (
        "no case could be measured: 3 failed; build_failed: error: unknown target CPU 'generic'"
    )
    told = noted()._why_none([*rows[:1], row_of("march", 1, bias_rms="1")], Path("out"))
    assert told.startswith("no case reaches a relative error of 1 %")
    assert "1 failed; build_failed: error: unknown target" in told


NAMES = (
    "my cloud",
    "wölkchen \U0001f600",
    "2024",
    "1e3",
    "true",
    "null",
    "-dash",
    "a: b",
    "x#y",
    "'\"",
)


@pytest.mark.parametrize("name", NAMES)
def test_names_of_files_and_folders_are_no_names_of_configs(name, work):
    known = catalog.load()
    medium = {"volume": {"file": str(work / f"{name}.npy"), "sigma_t": 1}}
    search = recommend.Search(known, None, work / name, medium, "transmittance", 0.01, 1, (), None)
    search.folder.mkdir()
    text = search.config_text([{"tracker": {"delta": {}}}], {"samples": 4})
    (search.folder / "round-1.yaml").write_text(text, "utf-8")
    loaded = config.load(str(search.folder / "round-1.yaml"), known.parameter_models(), ())
    (found,) = loaded.matrix.medium
    assert str(found.file) == medium["volume"]["file"]


def test_a_volume_is_found_where_run_finds_it(work, monkeypatch):
    (work / "far").mkdir()
    np.save(work / "far" / "away.npy", np.ones((4, 4, 4), np.float32))
    monkeypatch.setenv("FREEPATH_VOLUMES", str(work / "far"))
    assert volume_of(Path("away.npy"), 1.0)[1]["file"] == str(work / "far" / "away.npy")


def test_only_a_folder_of_its_own_is_emptied(work):
    others = work / "others"
    others.mkdir()
    (others / "notes.txt").write_text("mine")
    own_folder(work / "own", "recommend")
    for folder, command in ((others, "recommend"), (work / "own", "try")):
        with pytest.raises(UsageError, match="expected a folder that is empty, not there yet, or"):
            own_folder(folder, command)
    (work / "own" / "round-1").symlink_to(others)
    own_folder(work / "own", "recommend")
    assert [one.name for one in (work / "own").iterdir()] == [MARK]
    assert (others / "notes.txt").read_text() == "mine"


def test_what_is_known_is_told_when_it_is_interrupted(call, cloud, selector, monkeypatch):
    def interrupted(search):
        search.side = 2.0
        search.note(
            row_of("march", 1e-6, tracker_label="march-step=3", tightness="", bias_rms="0.001"),
            {"tracker": {"march": {"step": 3.0}}, "majorant": "global", "tightness": 1},
        )
        raise KeyboardInterrupt

    monkeypatch.setattr(recommend.Search, "run", interrupted)
    code, text = call(cloud)
    assert code == 130
    for told in (
        "interrupted; what is known so far:",
        "fastest: transmittance/m/march/auto/strict",
        "its step: 1.5 x a voxel, 3 in units of the scene",
        "sigma_t is the default, 1:",
    ):
        assert told in text
    found = freepath.recommend(cloud, sigma_t=1, devices=selector, output="again")
    assert (found.interrupted, found.best.tracker) == (True, "march")
    kept = [line for line in str(found).splitlines() if not re.search("again|measured in", line)]
    assert set(kept) < set(text.splitlines())


def test_what_hangs_may_take_so_long(call, cloud, monkeypatch):
    given = []

    def measured(sweep, part, timeout_s=None):
        given.append(timeout_s)
        raise KeyboardInterrupt

    monkeypatch.setattr(recommend.worker, "run", measured)
    assert call(cloud, "-o", "a", "--timeout", "7")[0] in (8, 130)
    assert call(cloud, "-o", "b")[0] in (8, 130)
    assert given == [7.0, None]
    assert call(cloud, "--timeout", "0")[0] == 2


def test_a_budget_that_is_used_up_says_what_is_missing():
    search = noted(row_of("march", 1e-6))
    search.spent_s = 2.0
    assert search._round(1, [{}] * 7) == 0
    assert search.lacks == ["majorants: 7 of 7 cases"]


def edge_of(axes, renderer=None):
    search = recommend.Search(catalog.load(), *[None] * 3, "transmittance", 0.01, 1, (), None)
    search.side, search.renderer = 0.5, renderer
    return search._further(axes, majorants_of((32, 32, 32)))


def test_what_lies_at_the_edge_of_the_search():
    tree = {"octree": {"resolution": 8, "slack": 0.25}}
    inside = {"tracker": {"ratio": {}}, "majorant": "global", "tightness": 1}
    assert edge_of(inside) == {}
    found = edge_of(inside | {"majorant": {"grid": {"resolution": [8, 8, 8]}}, "tightness": 2.5})
    assert list(found) == ["the finest grid", "the largest tightness"]
    assert found["the finest grid"]["majorant"] == {"grid": {"resolution": [16, 16, 16]}}
    assert list(edge_of(inside | {"majorant": tree})) == ["the finest octree"]
    march = inside | {"tracker": {"march": {"step": 0.5, "placement": "midpoint"}}}
    (told,) = edge_of(march).items()
    assert told[0] == "the smallest step"
    assert told[1]["tracker"] == {"march": {"step": 0.25, "placement": "midpoint"}}
    assert edge_of(march, RENDERERS["cycles"]) == {}


@pytest.mark.parametrize(("name", "count"), [("mitsuba", 1), ("pbrt", 2), ("cycles", 5)])
def test_a_renderer_is_offered_what_it_has(name, count, work):
    known, renderer = catalog.load(), RENDERERS[name]
    medium = {"volume": {"file": "c.npy", "sigma_t": 1}}
    search = recommend.Search(known, None, work, medium, "transmittance", 0.01, 1, (), None)
    search.renderer, search.had = renderer, renderer.points("ratio", 8, 0.5)
    (work / "r.yaml").write_text(search.config_text(search.had, {"samples": 4}))
    loaded = config.load("r.yaml", known.parameter_models(), ())
    cases = plan.expand(loaded, known)
    assert len(cases) == count
    for case in cases:
        axes = recommend.axes_of(case)
        assert search.is_had(recommend.Finding(None, axes))
        assert renderer.settings(axes, 0.5)
        axes["tracker"] = {"weighted_delta": {}}
        assert not search.is_had(recommend.Finding(None, axes))


def test_settings_follow_the_point():
    step = {"tracker": {"march": {"step": 1.0}}}
    assert "Step Rate Render 2 " in RENDERERS["cycles"].settings(step, 0.5)
    for cells, kind in ((16, "uniformgrid"), (64, "nanovdb")):
        point = {"majorant": {"grid": {"resolution": [cells] * 3}}}
        assert f'"{kind}"' in RENDERERS["pbrt"].settings(point, 0.5)
