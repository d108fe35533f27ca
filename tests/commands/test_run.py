"""Whole runs on a device: what they write, and how they go on after an interruption."""

import csv
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from freepath import api, cli
from freepath.compose import catalog, source
from freepath.measure import sweep
from freepath.measure.sweep import Listener, Sweep
from freepath.results import folder as results
from freepath.results.folder import COLUMNS, SAMPLE_COLUMNS, read_rows

SWEEP = """\
name: small
seed: 3
rays: {orthographic: {resolution: [8, 8]}}
matrix:
  medium: [homogeneous: {sigma_t: 1}, exponential: {sigma_t: 3, scale_height: 0.5}]
  tracker: [delta, regular]
stop: {samples: 100}
"""
SKIPPED = "transmittance/exponential-3-0.5/regular/auto/strict"
REGULAR = "transmittance/homogeneous-1/regular/auto/strict"


@pytest.fixture
def go(work, selector, capsys):
    """Run a config; returns the exit code and what was printed."""

    def go(*arguments, text=SWEEP):
        (work / "small.yaml").write_text(text)
        code = cli.main(["run", "small.yaml", "-d", selector, "-o", "out", *arguments])
        return code, capsys.readouterr()

    return go


def rows(folder="out"):
    return {row["case"]: row for row in read_rows(Path(folder) / "summary.csv")}


def samples(folder="out"):
    return read_rows(Path(folder) / "samples.csv", SAMPLE_COLUMNS)


def facts(folder="out"):
    return json.loads((Path(folder) / "run.json").read_text())


def test_what_a_run_leaves(go, work, device):
    code, printed = go()
    assert (code, printed.err) == (0, "")
    assert sorted(path.name for path in (work / "out").iterdir()) == [
        "run.json",
        "samples.csv",
        "summary.csv",
    ]
    found = rows()
    assert [row["status"] for row in found.values()].count("ok") == 3
    skipped = found[SKIPPED]
    assert skipped["status"] == "skipped"
    assert skipped["reason"] == "regular needs cells, which exponential does not offer"
    for case, row in found.items():
        assert tuple(row) == COLUMNS
        assert "nan" not in row.values()
        assert row["device"] == device.info.name
        assert row["rays"] == "64"
        assert re.fullmatch("[0-9a-f]{64}", row["config_sha256"])
        if case != SKIPPED:
            assert row["samples_per_ray"] == "100"
            assert re.fullmatch("[0-9a-f]{64}", row["source_sha256"])
            assert abs(float(row["bias"])) < 0.1
    for column in ("time_per_sample_s", "estimate", "variance", "lookups_per_sample", "truncated"):
        assert skipped[column] == ""


def test_a_row_a_round(go):
    go()
    for case, row in rows().items():
        own = [one for one in samples() if one["case_id"] == row["case_id"]]
        assert len(own) == (int(row["rounds"]) if row["rounds"] else 0), case
        assert sum(int(one["samples"]) for one in own) == (0 if case == SKIPPED else 6400)
        assert {one["run_id"] for one in own} <= {row["run_id"]}
        assert [int(one["round"]) for one in own] == list(range(len(own)))


def test_what_run_json_tells(go, device):
    go()
    told = facts()
    assert told["config_text"] == SWEEP
    assert told["config"]["stop"]["samples"] == 100
    assert told["seed"] == 3
    assert told["devices"][0]["driver_version"] == device.info.driver_version
    assert told["build_options"]["fast"] == list(source.BUILD_OPTIONS["fast"])
    (session,) = told["sessions"]
    assert session["ended"] == "complete"
    assert session["host"]["freepath"]
    assert session["host"]["packages"]["numpy"]
    assert session["time_wall_s"] > session["time_device_s"] > 0
    for case in told["cases"]:
        row = rows()[case["case"]]
        for column in ("case_id", "source_sha256", "config_sha256"):
            assert case[column] == row[column]


def test_rows_are_on_the_disk_as_each_case_ends(work, device):
    (work / "small.yaml").write_text(SWEEP)
    seen = []

    class Looking(Listener):
        def row(self, row):
            with open("out/summary.csv", newline="") as file:
                seen.append([line["case_id"] for line in csv.DictReader(file)])
            assert seen[-1][-1] == row["case_id"]

    api.sweep("small.yaml", "out", devices=[device], listener=Looking()).run()
    assert [len(ids) for ids in seen] == [1, 2, 3, 4]


def test_a_complete_run_is_not_run_again(go, work):
    go()
    before = {path.name: path.read_bytes() for path in (work / "out").iterdir()}
    code, printed = go("--resume")
    assert code == 0
    assert {path.name: path.read_bytes() for path in (work / "out").iterdir()} == before
    assert "nothing was left to run" in printed.out
    assert "delta global x1" in printed.out


class Interrupted(Sweep):
    """Is interrupted when its second row should be written."""

    def finish(self, row, rounds=(), *further):
        if len(rows()) == 1:
            self.folder._append("samples.csv", SAMPLE_COLUMNS, rounds)
            raise KeyboardInterrupt
        super().finish(row, rounds, *further)


def test_an_interrupted_run_is_completed(go, work, device, monkeypatch):
    (work / "small.yaml").write_text(SWEEP)
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(sweep, "Sweep", Interrupted)
        api.sweep("small.yaml", "out", devices=[device]).run()
    first = (work / "out" / "summary.csv").read_bytes().splitlines()[1]
    assert [session["ended"] for session in facts()["sessions"]] == ["interrupted"]
    code, _ = go("--resume")
    assert code == 0
    lines = (work / "out" / "summary.csv").read_bytes().splitlines()
    assert lines[1] == first
    assert len(lines) == 5
    assert [session["ended"] for session in facts()["sessions"]] == ["interrupted", "complete"]
    assert len({row["run_id"] for row in rows().values()}) == 2
    places = [(one["case_id"], one["round"]) for one in samples()]
    assert len(set(places)) == len(places)
    for row in rows().values():
        assert sum(one["case_id"] == row["case_id"] for one in samples()) == int(row["rounds"] or 0)


def run_ids():
    return {case: row["run_id"] for case, row in rows().items()}


def test_another_stop_rule_runs_again(go):
    go()
    before = run_ids()
    assert go("--resume", text=SWEEP.replace("samples: 100", "samples: 80"))[0] == 0
    after = run_ids()
    assert set(after) == set(before)
    assert not set(after.values()) & set(before.values())
    assert {row["samples_per_ray"] for row in rows().values()} == {"80", ""}
    assert {one["run_id"] for one in samples()} == set(after.values())


def test_more_cases_run_alone(go):
    go("-a", "tracker=regular")
    before = run_ids()
    go("--resume")
    after = run_ids()
    assert {case: run_id for case, run_id in after.items() if case in before} == before
    assert len(after) == 4


def test_a_filter_deletes_nothing(go):
    go()
    before = run_ids()
    code, printed = go("--resume", "-R", "regular")
    assert code == 0
    assert run_ids() == before
    assert "delta global x1" in printed.out


def test_a_tracker_that_was_edited_runs_again(go, work):
    folder = work / "trackers"
    folder.mkdir()
    mine = folder / "mine.cl"
    mine.write_text(catalog.load().trackers["delta"].source)
    given = ("-a", "tracker=regular,mine", "-a", "medium={homogeneous: {sigma_t: 1}}")
    assert go("--trackers", "trackers", *given)[0] == 0
    before = run_ids()
    mine.write_text(mine.read_text() + "/* edited */\n")
    assert go("--trackers", "trackers", *given, "--resume")[0] == 0
    after = run_ids()
    assert after[REGULAR] == before[REGULAR]
    (edited,) = (case for case in after if "mine" in case)
    assert after[edited] != before[edited]
    assert {one["run_id"] for one in samples()} == set(after.values())


def test_another_volume_of_the_same_name_runs_again(go, work):
    np.save(work / "v.npy", np.ones((4, 4, 4), np.float32))
    given = ("-a", "medium={volume: {file: v.npy}}", "-a", "tracker=regular")
    go(*given)
    before = run_ids()
    used = "v.npy: 4 x 4 x 4 voxels [z, y, x] of float32"
    assert [row["inputs"] for row in rows().values()] == [used]
    assert go(*given, "--resume")[0] == 0
    assert run_ids() == before
    np.save(work / "v.npy", np.full((4, 4, 4), 2, np.float32))
    go(*given, "--resume")
    assert run_ids() != before
    assert len(rows()) == 1


def test_a_run_json_that_is_lost_or_damaged_is_no_hindrance(go, work):
    go("-a", "tracker=regular")
    (work / "out" / "run.json").write_text("{")
    assert go("--resume")[0] == 0
    assert [session["cases_to_run"] for session in facts()["sessions"]] == [2]


BROKEN = """\
/*---
title: Mine
estimands: [transmittance]
needs: [majorant]
---*/
static void begin(Path *path, const Scene *scene, Rng *rng) { walk_begin(path, scene); }
static void step(Path *path, const Scene *scene, Rng *rng) { collide(path, path->nonsense); }
"""


def test_a_tracker_that_does_not_compile_is_a_row(go, work):
    (work / "trackers").mkdir()
    (work / "trackers" / "broken.cl").write_text(BROKEN)
    given = ("--trackers", "trackers", "-a", "tracker=broken,regular")
    code, printed = go(*given)
    assert code == 8
    found = rows()
    broken = [row for row in found.values() if row["tracker"] == "broken"]
    assert {row["status"] for row in broken} == {"build_failed"}
    for row in broken:
        assert "trackers/broken.cl:7" in row["reason"]
        assert "nonsense" in row["reason"]
        assert row["estimate"] == row["time_per_sample_s"] == row["rounds"] == ""
    assert found[REGULAR]["status"] == "ok"
    (said,) = printed.err.splitlines()
    assert said.startswith("freepath: build_failed: trackers/broken.cl:7:")
    assert "2 cases, the first of them transmittance/homogeneous-1/global/t1/broken" in said
    log = re.search(r"build-\w+\.log", broken[0]["reason"])[0]
    assert "nonsense" in (work / "out" / log).read_text()
    # what failed is tried again, what is done is not
    before = run_ids()
    assert go(*given, "--resume")[0] == 8
    assert run_ids()[REGULAR] == before[REGULAR]
    assert run_ids()[broken[0]["case"]] != before[broken[0]["case"]]


def test_a_wrong_tracker_is_a_mismatch(go, work):
    (work / "trackers").mkdir()
    wrong = catalog.load().trackers["delta"].source
    wrong = wrong.replace("uniform(rng) * path->majorant", "uniform(rng) * path->majorant * 0.8f")
    (work / "trackers" / "wrong.cl").write_text(wrong)
    given = ("--trackers", "trackers", "-a", "tracker=wrong", "-R", "exponential")
    code, printed = go(*given, text=SWEEP.replace("samples: 100", "samples: 10000"))
    assert code == 8
    (row,) = rows().values()
    assert row["status"] == "mismatch"
    assert abs(float(row["z_score"])) > 6
    assert "mismatch" in printed.out


def test_a_thick_medium_is_no_mismatch(go):
    code, _ = go("-a", "medium={homogeneous: {sigma_t: 60}}", "-a", "tracker=delta,regular")
    assert code == 0
    delta, regular = (
        next(r for r in rows().values() if r["tracker"] == t) for t in ("delta", "regular")
    )
    assert (delta["estimate"], delta["time_to_1pct_s"]) == ("0.0", "")
    assert delta["reason"].startswith("all scores are 0")
    assert float(regular["bias"]) == pytest.approx(0, abs=1e-3 * math.exp(-60))


def test_a_variance_of_rare_high_weights_is_not_known(go):
    """weighted_delta at tightness 0.5: the fourth moment of its weights is exp(26) and more."""
    text = (
        "name: x\nrays: {single: {origin: [0, 0.5, 0.5], direction: [1, 0, 0]}}\n"
        "matrix: {medium: {homogeneous: {sigma_t: 2.3}}, tightness: 0.5, "
        "tracker: [weighted_delta, delta]}\nstop: {samples: 400000}\n"
    )
    code, _ = go(text=text)
    assert code == 0
    weighted, plain = sorted(rows().values(), key=lambda row: row["tracker"], reverse=True)
    assert weighted["variance_noise"] == ""
    assert "its variance is not known" in weighted["reason"]
    assert 0 < float(plain["variance_noise"]) < 0.2
    # of a single ray so many are counted that lookups are known: majorant x length, 1.15
    assert float(weighted["counted_samples"]) == 65536


def test_a_majorant_that_does_not_bound_is_reported(go):
    code, _ = go("-a", "tightness=0.5", "-a", "tracker=delta", "-R", "homogeneous")
    assert code == 0
    (row,) = rows().values()
    assert row["status"] == "ok"
    assert float(row["violations"]) > 0
    assert row["reason"] == "100 % of the lookups were above the majorant"


def test_estimates_are_the_same_for_the_same_seed(go, work):
    found = []
    for _ in range(2):
        go("-a", "tracker=delta")
        found.append({case: row["estimate"] for case, row in rows().items()})
        (work / "out").rename(work / f"out{len(found)}")
    assert found[0] == found[1]


def test_folders_are_named_after_config_and_time(work):
    first = results.new_folder("small")
    assert re.fullmatch(r"small-\d{8}-\d{6}", first.name)
    for name in ("small-20200101-000000", "small-20210101-000000", "small-2-20220101-000000"):
        (work / "results" / name).mkdir(parents=True)
    (work / "results" / "small-notes").mkdir()
    assert results.newest_folder("small").name == "small-20210101-000000"
    assert results.newest_folder("small-2").name == "small-2-20220101-000000"
    with pytest.raises(results.FreepathError, match="no run of other in results/ to resume"):
        results.newest_folder("other")


def test_two_runs_in_a_second_have_two_folders(work, monkeypatch):
    monkeypatch.setattr(results, "STAMP", "20200101-000000")
    names = []
    for _ in range(3):
        folder = results.new_folder("small")
        folder.mkdir(parents=True)
        names.append(folder.name)
    assert names == ["small-20200101-000000", "small-20200101-000000-2", "small-20200101-000000-3"]
    assert results.newest_folder("small").name == names[-1]


def test_repeated_into_folders_that_compare_takes(go, capsys):
    assert go("--repeat", "2")[0] == 0
    assert sorted(path.name for path in Path("out").iterdir()) == ["small-1", "small-2"]
    first, second = rows("out/small-1"), rows("out/small-2")
    assert {row["run_id"] for row in first.values()} != {row["run_id"] for row in second.values()}
    assert {case: row["estimate"] for case, row in first.items()} == {
        case: row["estimate"] for case, row in second.items()
    }
    assert cli.main(["compare", "out", "out", "--json"]) in (0, 1)
    assert go("--repeat", "2")[0] == 2  # they are there
    assert go("--repeat", "3", "--resume")[0] == 0
    assert rows("out/small-2") == second
    assert len(rows("out/small-3")) == len(first)
    for wrong in (("--repeat", "0"), ("--repeat", "2", "--json")):
        code, printed = go(*wrong)
        assert code == 2
        assert "--repeat: expected 1 or more" in printed.err
