"""A case that ends the process is got past, and costs no other case its row."""

import subprocess
import sys

import pytest

from freepath.errors import FreepathError
from freepath.results.folder import read_rows
from freepath.results.journal import FILE, Journal

CRASHES = """/*---
title: A tracker that writes where nothing is
estimands: [transmittance]
needs: [majorant]
---*/
static void begin(Path *path, const Scene *scene, Rng *rng) { walk_begin(path, scene); }
static void step(Path *path, const Scene *scene, Rng *rng)
{
    *(volatile __global int *)(ulong)8 = 1;
    escape(path, path->live);
}
"""
CONFIG = """name: crash
rays: {orthographic: {resolution: 4}}
matrix:
  estimand: transmittance
  medium: [{homogeneous: {sigma_t: 1}}, {homogeneous: {sigma_t: 2}}]
  tracker: [delta, crashes, ratio]
stop: {samples: 64, rounds: 2}
"""
KEY, OTHER = ("case", "device"), ("other", "device")


def left_by(folder, *at_work):
    """What a process leaves that ended while these cases were at work, one after the other."""
    journal = Journal(folder)
    journal.open()
    for key in at_work:
        journal.work_at(key)


def test_a_process_that_ends_counts_against_the_case_at_work(tmp_path):
    left_by(tmp_path, OTHER, KEY)
    left_by(tmp_path, KEY)
    journal = Journal(tmp_path)
    journal.open()
    assert (journal.deaths_at(KEY), journal.deaths_at(OTHER)) == (2, 0)


def test_an_end_in_order_counts_against_none(tmp_path):
    journal = Journal(tmp_path)
    journal.open()
    journal.work_at(KEY)
    journal.close()
    assert not (tmp_path / FILE).exists()
    left_by(tmp_path, KEY)
    journal.open()
    journal.work_at(OTHER)
    journal.close()
    # an interruption forgets nothing
    assert (tmp_path / FILE).exists()
    journal.open()
    assert journal.deaths_at(KEY) == 1
    journal.done(KEY)
    journal.close()
    assert not (tmp_path / FILE).exists()


@pytest.mark.parametrize("text", ["", "{", "[]", '{"at_work": 1}', '{"deaths": [], "at_work": ""}'])
def test_a_file_that_was_cut_off_says_nothing(tmp_path, text):
    (tmp_path / FILE).write_text(text)
    journal = Journal(tmp_path)
    journal.open()
    assert journal.deaths_at(KEY) == 0


def test_a_row_clears_all_versions_of_a_case_and_no_other(tmp_path):
    other = ("case-2", *KEY[1:])
    left_by(tmp_path, (*KEY, "driver 1"))
    left_by(tmp_path, (*KEY, "driver 2"))
    left_by(tmp_path, other)
    journal = Journal(tmp_path)
    journal.open()
    journal.done(("case",))
    assert [journal.deaths_at((*KEY, f"driver {n}")) for n in (1, 2)] == [0, 0]
    assert journal.deaths_at(other) == 1


def test_a_file_that_cannot_be_written_is_told(tmp_path):
    journal = Journal(tmp_path / "gone")
    with pytest.raises(FreepathError, match=r"gone/at-work.json: cannot be written: No such file"):
        journal.open()


def test_a_run_gets_past_a_case_that_ends_the_process(work, selector):
    """Two such cases end it twice each; then they have rows, as all others have."""
    (work / "trackers").mkdir()
    (work / "trackers" / "crashes.cl").write_text(CRASHES)
    (work / "crash.yaml").write_text(CONFIG)
    command = [sys.executable, "-m", "freepath", "run", "crash.yaml", "-d", selector, "-o", "out"]
    command += ["--trackers", "trackers"]
    codes, found = [], {}
    for turn in range(8):
        resumed = ["--resume"] if turn else []
        ended = subprocess.run([*command, *resumed], capture_output=True, text=True, check=False)
        codes.append(ended.returncode)
        found = {row["case"]: row for row in read_rows(work / "out" / "summary.csv")}
        if ended.returncode >= 0:
            break
    assert codes == [-11] * 4 + [8], ended.stderr
    status = {name: row["status"] for name, row in found.items()}
    assert len(status) == 6
    assert all(
        (status[name] == "crashed") == ("crashes" in name) and status[name] in ("ok", "crashed")
        for name in status
    )
    assert "2 times while this case was" in next(
        row["reason"] for row in found.values() if row["status"] == "crashed"
    )
    assert not (work / "out" / FILE).exists()
