import csv
import json
import math
import re

import numpy as np
import pytest

from freepath.cli import main
from freepath.errors import FreepathError
from freepath.results.folder import (
    COLUMNS,
    KEY,
    PLACE,
    SAMPLE_COLUMNS,
    SUMMARY,
    TEXTS,
    ResultFolder,
    key_of,
    read_rows,
    records,
)
from freepath.results.reading import MEASURED


def row_of(case="a", **given):
    row = dict.fromkeys(COLUMNS) | {
        "schema_version": 1,
        "run_id": "run1",
        "case_id": case,
        "case": f"transmittance/m/{case}/auto/strict",
        "status": "ok",
        "reason": "",
        "device": "thing",
        "platform": "maker",
        "driver_version": "1",
        "config_sha256": "c",
        "source_sha256": "s",
        "majorant": "none",
        "estimate": 0.1,
    }
    row |= dict.fromkeys(MEASURED[:4], 1) | dict.fromkeys(MEASURED[5:], 0.5)
    return row | given


def rounds_of(row, count=2):
    empty = dict.fromkeys(SAMPLE_COLUMNS)
    shared = {column: row[column] for column in empty if column in row}
    empty |= shared | {"samples": 1, "time_device_s": 0.1, "time_wall_s": 0.1}
    return [empty | {"round": number} for number in range(count)]


def written(folder, *rows):
    """A folder with these rows, each with two rounds."""
    results = ResultFolder(folder)
    results.open([])
    for row in rows:
        results.append(row, rounds_of(row))
    results.write_run({"sessions": []})
    results.close()
    return results


def resumed(folder, *planned):
    """Go on with a folder; returns it and the keys of what it had already."""
    results = ResultFolder(folder, resume=True)
    done = results.open(planned)
    results.close()
    return results, done


def lines_of(folder, name=SUMMARY):
    return (folder / name).read_bytes().splitlines()


def samples_of(folder):
    return [
        (r["case_id"], r["device"], r["round"])
        for r in read_rows(folder / "samples.csv", SAMPLE_COLUMNS)
    ]


def test_every_row_has_every_column(tmp_path):
    written(tmp_path, row_of("a"), row_of("b", status="skipped", reason="why, oh why"))
    with (tmp_path / SUMMARY).open(newline="") as file:
        lines = list(csv.reader(file))
    assert tuple(lines[0]) == COLUMNS
    assert [len(line) for line in lines] == [len(COLUMNS)] * 3
    assert b"\r" not in (tmp_path / SUMMARY).read_bytes()


def test_cells_are_empty_or_full_numbers(tmp_path):
    given = {
        "estimate": 0.1 + 0.2,
        "bias": None,
        "variance_noise": math.nan,
        "time_to_1pct_s": math.inf,
        "rmse": np.float64(1e-300),
        "rays": np.int64(7),
        "z_score": np.float32(0.5),
    }
    (row,) = written(tmp_path, row_of(**given)).rows()
    assert float(row["estimate"]) == 0.1 + 0.2
    assert (row["bias"], row["variance_noise"], row["time_to_1pct_s"]) == ("", "", "inf")
    assert (row["rmse"], row["rays"], row["z_score"]) == ("1e-300", "7", "0.5")


def test_rows_are_there_as_soon_as_they_are_appended(tmp_path):
    results = ResultFolder(tmp_path)
    results.open([])
    for count, case in enumerate("abc", 1):
        results.append(row_of(case), rounds_of(row_of(case)))
        assert len(read_rows(tmp_path / SUMMARY)) == count
        assert len(samples_of(tmp_path)) == 2 * count


def test_what_is_in_the_folder_is_not_overwritten(tmp_path):
    written(tmp_path, row_of())
    with pytest.raises(
        FreepathError, match="already holds summary.csv, samples.csv, run.json; go on"
    ):
        ResultFolder(tmp_path)


def test_a_file_of_the_users_is_not_overwritten(tmp_path):
    (tmp_path / "samples.csv").write_text("mine")
    with pytest.raises(FreepathError, match="already holds samples.csv"):
        ResultFolder(tmp_path)


def test_looking_makes_no_folder(tmp_path):
    ResultFolder(tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_folders_that_cannot_be(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FreepathError, match="is a file"):
        ResultFolder(tmp_path / "file")
    with pytest.raises(FreepathError, match="cannot be written to: Not a directory"):
        ResultFolder(tmp_path / "file" / "below").open([])
    with pytest.raises(FreepathError, match="holds no run to resume"):
        ResultFolder(tmp_path / "none", resume=True)
    with pytest.raises(FreepathError, match="cannot be looked into: File name too long"):
        ResultFolder(tmp_path / ("x" * 300))


def test_rows_that_stand_are_kept_to_the_byte(tmp_path):
    rows = [row_of("a", reason='a, "b"', estimate=0.1), row_of("b", estimate=1e-17)]
    written(tmp_path, *rows)
    before = lines_of(tmp_path), lines_of(tmp_path, "samples.csv")
    _, done = resumed(tmp_path, *rows, row_of("c"))
    assert (lines_of(tmp_path), lines_of(tmp_path, "samples.csv")) == before
    assert done == {key_of(row) for row in rows}


@pytest.mark.parametrize("column", ["driver_version", "config_sha256", "source_sha256"])
def test_a_row_of_another_hash_goes_with_its_rounds(tmp_path, column):
    written(tmp_path, row_of("a"), row_of("b"))
    _, done = resumed(tmp_path, row_of("a", **{column: "new"}), row_of("b"))
    assert done == {key_of(row_of("b"))}
    assert [row["case_id"] for row in read_rows(tmp_path / SUMMARY)] == ["b"]
    assert samples_of(tmp_path) == [("b", "thing", "0"), ("b", "thing", "1")]


@pytest.mark.parametrize("status", ["run_failed", "build_failed"])
def test_a_row_that_failed_is_made_again(tmp_path, status):
    written(tmp_path, row_of("a", status=status))
    assert resumed(tmp_path, row_of("a"))[1] == set()
    assert read_rows(tmp_path / SUMMARY) == []


@pytest.mark.parametrize("status", ["crashed", "timeout"])
def test_a_row_that_is_known_to_kill_stands(tmp_path, status):
    written(tmp_path, row_of("a", status=status))
    assert resumed(tmp_path, row_of("a"))[1] == {key_of(row_of("a"))}


def test_rows_that_are_not_asked_for_are_left_alone(tmp_path):
    """Resuming with a filter, or on another device, must not delete the rest."""
    rows = [row_of("a"), row_of("b"), row_of("a", device="other"), row_of("a", platform="other")]
    written(tmp_path, *rows)
    before = lines_of(tmp_path)
    _, done = resumed(tmp_path, row_of("b"))
    assert lines_of(tmp_path) == before
    assert done == {key_of(row_of("b"))}
    assert len(samples_of(tmp_path)) == 8


def test_rounds_without_a_row_go(tmp_path):
    """Their case was interrupted; another device's rounds of the same case must not keep them."""
    results = written(tmp_path, row_of("a", device="first"))
    results._append("samples.csv", SAMPLE_COLUMNS, rounds_of(row_of("a", device="second")))
    resumed(tmp_path, row_of("a", device="first"), row_of("a", device="second"))
    assert samples_of(tmp_path) == [("a", "first", "0"), ("a", "first", "1")]


def test_rounds_of_an_earlier_run_of_a_row_go(tmp_path):
    results = written(tmp_path, row_of("a", run_id="run2"))
    results._append("samples.csv", SAMPLE_COLUMNS, rounds_of(row_of("a", run_id="run1")))
    resumed(tmp_path, row_of("a"))
    assert len(samples_of(tmp_path)) == 2


@pytest.mark.parametrize("share", [0.02, 0.5, 0.9, 0.99])
def test_a_row_that_was_cut_off_is_made_again(tmp_path, share):
    rows = [row_of("a"), row_of("b", reason="naïve, 10 µs", config_sha256="f" * 64)]
    written(tmp_path, *rows)
    whole = (tmp_path / SUMMARY).read_bytes()
    start = whole.rindex(b"1,run1,b")
    (tmp_path / SUMMARY).write_bytes(whole[: start + int(share * (len(whole) - start))])
    _, done = resumed(tmp_path, *rows)
    assert done == {key_of(rows[0])}
    assert lines_of(tmp_path) == whole.splitlines()[:2]


def test_a_row_cut_off_within_a_character_is_survived(tmp_path):
    written(tmp_path, row_of("a"), row_of("b", reason="µ"))
    whole = (tmp_path / SUMMARY).read_bytes()
    (tmp_path / SUMMARY).write_bytes(whole[: whole.rindex("µ".encode()) + 1])
    assert resumed(tmp_path, row_of("a"), row_of("b"))[1] == {key_of(row_of("a"))}


def test_a_missing_line_end_does_not_join_rows(tmp_path):
    written(tmp_path, row_of("a"))
    (tmp_path / SUMMARY).write_bytes((tmp_path / SUMMARY).read_bytes().rstrip(b"\n"))
    results, done = resumed(tmp_path, row_of("a"), row_of("b"))
    results.append(row_of("b"))
    # whether its last cell is whole cannot be told
    assert done == set()
    assert [row["case_id"] for row in results.rows()] == ["b"]


def test_files_of_another_version_are_refused(tmp_path):
    (tmp_path / SUMMARY).write_text("a,b\n1,2\n")
    with pytest.raises(FreepathError, match="its columns are not those of schema version 6"):
        resumed(tmp_path)


def test_two_do_not_write_to_one_folder(tmp_path):
    first = written(tmp_path, row_of())
    first._acquire()
    with pytest.raises(FreepathError, match="another freepath is writing there"):
        resumed(tmp_path, row_of())
    first.close()
    resumed(tmp_path, row_of())
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "run.json",
        "samples.csv",
        "summary.csv",
    ]


def test_run_json_is_read_where_it_can_be(tmp_path):
    results = written(tmp_path, row_of())
    results.write_run({"seed": 7})
    assert results.read_run() == {"seed": 7}
    for text in ("{", "[]", ""):
        (tmp_path / "run.json").write_text(text)
        assert results.read_run() == {}
    (tmp_path / "run.json").unlink()
    assert results.read_run() == {}


def test_run_json_is_valid_json(tmp_path):
    with pytest.raises(ValueError):
        written(tmp_path, row_of()).write_run({"x": math.inf})


def test_records_are_numbers_and_texts(tmp_path):
    case_id = "1234567890e1"  # hexadecimal, and looks like a number
    row = row_of(case_id, time_to_1pct_s=math.inf, rays=5, tightness=2.0, driver_version="3.0")
    (record,) = records(written(tmp_path, row).rows())
    assert record["case_id"] == case_id
    assert record["driver_version"] == "3.0"
    assert (record["estimate"], record["rays"], record["tightness"]) == (0.1, 5, 2.0)
    assert isinstance(record["rays"], int)
    assert record["bias"] is None
    assert record["time_to_1pct_s"] == "inf"
    json.dumps(record, allow_nan=False)


def test_columns():
    assert len(set(COLUMNS)) == len(COLUMNS)
    assert len(set(SAMPLE_COLUMNS)) == len(SAMPLE_COLUMNS)
    assert set(COLUMNS) > TEXTS
    assert set(KEY) > set(PLACE)


def damaged(folder, name, old, new):
    """A result of two cases with a change in one of its files."""
    told = {"rays": 4, "samples_per_ray": 50, "rounds": 2}
    results = ResultFolder(folder)
    results.open([])
    for row in (row_of("a", **told), row_of("b", **told)):
        results.append(row, [one | {"samples": 100} for one in rounds_of(row)])
    results.write_run({"sessions": []})
    results.close()
    text = (folder / name).read_text()
    assert old in text
    (folder / name).write_bytes(text.replace(old, new, 1).encode("utf-8", "surrogateescape"))


DAMAGES = [
    (
        SUMMARY,
        ",0.1,",
        ",abc,",
        f"summary.csv:2: column {COLUMNS.index('estimate') + 1}, estimate: expected a number,",
    ),
    (SUMMARY, ",0.1,", ",nan,", "estimate: expected a number, got 'nan'"),
    (SUMMARY, ",0.1,", ",1e400,", "estimate: expected a number, got '1e400'"),
    (SUMMARY, ",0.1,", ",0_1,", "estimate: expected a number, got '0_1'"),
    (SUMMARY, ",0.1,", ",,", "estimate: expected a number, as the status is ok"),
    (
        SUMMARY,
        ",0.1,,",
        ",",
        f"summary.csv:2: expected {len(COLUMNS)} cells, as the first line has, got fewer",
    ),
    (SUMMARY, ",thing,", ",\x1b]0;x\x07,", "summary.csv:2: column 7, device: holds a control"),
    (SUMMARY, ",none,", ",grid-8,", "summary.csv:2: column 17, tightness: expected a number, as"),
    (SUMMARY, "/a/auto/strict", "", "summary.csv:2: column 4, case: expected estimand/medium/"),
    (SUMMARY, ",ok,", ",fine,", "summary.csv:2: column 5, status: expected one of ok, skipped"),
    (SUMMARY, ",2,", ",3,", "summary.csv:2: transmittance/m/a/auto/strict: expected 3 rounds of"),
    ("samples.csv", ",100,", ",-100,", "samples.csv:2: column 7, samples: expected a whole number"),
    (
        "samples.csv",
        ",0.1,",
        ",-0.1,",
        "samples.csv:2: column 9, time_device_s: expected 0 or more",
    ),
    ("samples.csv", ",0.1,", ",,", "samples.csv:2: column 9, time_device_s: expected a number"),
    ("samples.csv", ",1,100,", ",99999,100,", "expected 2 rounds of 200 samples in all beside it"),
    ("samples.csv", ",100,", ",10,", "expected 2 rounds of 200 samples in all beside it, found 2"),
    (
        "samples.csv",
        "b,thing,maker,1,100,,0.1,0.1,,0.1,0.5\n",
        "b,th",
        "expected 2 rounds of 200 samples in all beside",
    ),
]


@pytest.mark.parametrize(("name", "old", "new", "told"), DAMAGES)
def test_what_no_run_has_written_is_refused_in_one_line(tmp_path, capsys, name, old, new, told):
    """By all that read results; a row that a crash cut off is none of it."""
    damaged(tmp_path / "out", name, old, new)
    for command in (["report", "out"], ["compare", "out", "out"], ["report", "out", "out"]):
        words = [str(tmp_path / word) if word == "out" else word for word in command]
        assert main(words) == 2
        error = capsys.readouterr().err
        assert told in error
        assert len(error.splitlines()) == 1
    with pytest.raises(FreepathError, match=re.escape(told)):
        resumed(tmp_path / "out", row_of("a"), row_of("b"))


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, '{"x": NaN}', "[]", "\ufeff{}"])
def test_a_damaged_run_json_is_refused(tmp_path, capsys, text):
    damaged(tmp_path / "out", "run.json", "{", "{")
    (tmp_path / "out/run.json").write_text(text)
    for command in ("report", "compare"):
        assert main([command, str(tmp_path / "out"), str(tmp_path / "out")]) == 2
        error = capsys.readouterr().err
        assert "run.json: " in error
        assert len(error.splitlines()) == 1


def test_an_empty_summary_is_refused(tmp_path):
    (tmp_path / SUMMARY).write_text("")
    with pytest.raises(FreepathError, match="its columns are not those of schema version 6"):
        resumed(tmp_path)


def test_the_case_at_work_when_all_was_killed_is_known(tmp_path):
    """Until the next run has taken over, which has a case of its own, or none when it ends."""
    killed = ResultFolder(tmp_path / "out")
    killed.open([])
    assert killed.noted == ""
    killed.note("a/long/name/of/a/case")
    killed.note("short\x1b[31m")
    (tmp_path / "out" / ".lock").unlink()  # the system lets go of it
    following = ResultFolder(tmp_path / "out", resume=True)
    assert following.noted == "short?[31m"
    following.open([])
    assert following.noted == ""
    following.close()
    assert not (tmp_path / "out" / ".at-work").exists()
    assert following.noted == ""


def test_what_is_at_work_is_noted_in_no_other_file(tmp_path):
    written(tmp_path / "out")
    (tmp_path / "victim").write_text("mine")
    (tmp_path / "out" / ".at-work").symlink_to(tmp_path / "victim")
    with pytest.raises(FreepathError, match="cannot be written to"):
        resumed(tmp_path / "out")
    assert (tmp_path / "victim").read_text() == "mine"
    assert ResultFolder(tmp_path / "out", resume=True).noted == ""
