"""What hangs or ends the process of a sweep costs one case its row, and no other."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest

from freepath import api
from freepath.errors import ResultError, RunError
from freepath.measure import pictures, worker
from freepath.measure import sweep as sweeps
from freepath.results import folder as results
from freepath.results.folder import read_rows
from freepath.show.report import writing

FRONT = """/*---
title: A tracker that {0}
estimands: [transmittance]
needs: [majorant]
---*/
static void begin(Path *path, const Scene *scene, Rng *rng) {{ walk_begin(path, scene); }}
static void step(Path *path, const Scene *scene, Rng *rng)
{{
    {1}
    escape(path, path->live);
}}
"""
PLANTED = {
    "crashes": "*(volatile __global int *)(ulong)8 = 1;",
    "aborts": "__builtin_trap();",
    "hangs": "volatile int forever = 1; while (forever) { }",
}
CONFIG = """name: planted
rays: {orthographic: {resolution: 4}}
matrix:
  medium: [{homogeneous: {sigma_t: 1}}, {homogeneous: {sigma_t: 2}}]
  tracker: [delta, ratio]
stop: {samples: 64, rounds: 2}
"""


@pytest.fixture
def planted(work):
    (work / "trackers").mkdir()
    for name, line in PLANTED.items():
        (work / "trackers" / f"{name}.cl").write_text(FRONT.format(name, line))
    (work / "planted.yaml").write_text(CONFIG)
    return work


@pytest.fixture
def command(planted, selector):
    start = [sys.executable, "-m", "freepath", "run", "planted.yaml", "--trackers", "trackers"]
    return [*start, "-d", selector, "-o", "out"]


def ended(command, **options):
    return subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=300, **options
    )


def rows(folder="out"):
    return read_rows(results.Path(folder) / "summary.csv")


@pytest.mark.parametrize(
    ("tracker", "status", "reason"),
    [
        ("crashes", "crashed", "its process was ended by SIGSEGV, also when it was tried again"),
        ("aborts", "crashed", "its process was ended by SIG"),
        ("hangs", "timeout", "did not end within 4 s (--timeout), also when it was tried again"),
    ],
)
def test_a_sweep_gets_past_what_ends_or_stops_it(command, tracker, status, reason):
    """In one run; and --resume does not try it again."""
    only = ["-a", f"tracker=delta,{tracker},ratio", "-a", "medium={homogeneous: {sigma_t: 1}}"]
    done = ended([*command, *only, "--timeout", "4"])
    assert done.returncode == 8
    assert f"freepath: {status}: " in done.stderr
    found = {row["tracker"]: row for row in rows()}
    assert {name: row["status"] for name, row in found.items()} == {
        "delta": "ok",
        "ratio": "ok",
        tracker: status,
    }
    assert reason in found[tracker]["reason"]
    before = rows()
    (session,) = json.loads((results.Path("out") / "run.json").read_text())["sessions"]
    assert session["ended"] == "complete"
    assert ended([*command, *only, "--timeout", "4", "--resume"]).returncode == 8
    assert rows() == before


def test_memory_that_runs_out_for_a_case(planted, device, monkeypatch):
    """Beyond what is reckoned before; the others have their rows."""
    made = sweeps.runner_of

    def runner_of(case, *given):
        if case.tracker == "ratio":
            raise MemoryError("unable to allocate 9 GiB")
        return made(case, *given)

    monkeypatch.setattr(sweeps, "runner_of", runner_of)
    api.sweep("planted.yaml", "out", devices=[device]).run()
    assert {(row["tracker"], row["status"]) for row in rows()} == {
        ("delta", "ok"),
        ("ratio", "run_failed"),
    }
    assert {row["reason"] for row in rows() if row["tracker"] == "ratio"} == {
        "out of memory: unable to allocate 9 GiB"
    }


def children(process):
    return [
        one for one in psutil.Process(process.pid).children() if worker.__name__ in one.cmdline()
    ]


def at_work(process):
    """The process of the sweep, once it is at a case; that is forgotten, for the one after it."""
    until, noted = time.monotonic() + 120, results.Path("out") / results.AT_WORK
    while time.monotonic() < until:
        if noted.exists() and noted.stat().st_size:
            (one,) = children(process)
            os.truncate(noted, 0)
            return one
        time.sleep(0.1)
    raise AssertionError("no process of a sweep was seen")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_kernel_without_end_is_ended_with_the_run(command, number):
    running = subprocess.Popen([*command, "-a", "tracker=hangs"], stderr=subprocess.PIPE, text=True)
    try:
        hanging = at_work(running)
        time.sleep(3.0)
        running.send_signal(number)
        running.wait(timeout=worker.ENDING_S + 3)
        hanging.wait(timeout=3)
    finally:
        running.kill()
    assert running.returncode == (-signal.SIGKILL if number == signal.SIGKILL else 130)
    # nothing holds the folder
    assert ended([*command, "-a", "tracker=delta", "--resume"]).returncode == 0


def test_a_kill_from_outside_is_not_held_against_a_case(command):
    """Twice at the same case: its row says so, and --resume measures it."""
    running = subprocess.Popen(
        [*command, "-a", "tracker=hangs", "-a", "medium={homogeneous: {sigma_t: 1}}"],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        for _ in range(2):
            one = at_work(running)
            one.send_signal(signal.SIGKILL)
            one.wait(timeout=10)
        assert running.wait(timeout=60) == 8
    finally:
        running.kill()
    (row,) = rows()
    assert row["status"] == "run_failed"
    assert "SIGKILL, by whom is not known" in row["reason"]
    assert row["status"] not in results.FINAL


def test_who_ended_a_process():
    def verdict(*given):
        return worker._verdict(*given)["status"]

    assert verdict(-signal.SIGSEGV, 0.0, False) == "crashed"
    assert verdict(1, 0.0, False) == "crashed"
    assert verdict(-signal.SIGKILL, 0.0, False) == "run_failed"
    assert verdict(-signal.SIGKILL, 0.0, True) == "crashed"
    assert verdict(-signal.SIGKILL, 5.0, True) == "timeout"


def test_a_reader_that_has_seen_enough_ends_no_run(command):
    line = " ".join(f"'{word}'" for word in command)
    done = ended(["bash", "-c", f"{line} | head -1; exit ${{PIPESTATUS[0]}}"])
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == 1
    assert [row["status"] for row in rows()] == ["ok"] * 4


def test_rows_and_times_arrive_here(planted, device):
    from freepath.device.selection import first

    seen = []
    sweep = api.sweep("planted.yaml", "out")
    sweep.listener.row = lambda row: seen.append(row["case"])
    worker.run(sweep, first([]))
    assert seen == [row["case"] for row in rows()]
    assert (sweep.ended, sweep.total) == (4, 4)
    assert sweep.clock.build_s > 0
    with pytest.raises(results.FreepathError, match="already holds"):
        api.sweep("planted.yaml", "out")


def test_what_is_wrong_before_a_case_is_at_work_is_raised_here(planted, device):
    from freepath.device.selection import first

    text = CONFIG.replace(
        "[{homogeneous: {sigma_t: 1}}, {homogeneous: {sigma_t: 2}}]", "{volume: {file: no.npy}}"
    )
    (planted / "planted.yaml").write_text(text)
    with pytest.raises(results.FreepathError, match=r"no\.npy"):
        worker.run(api.sweep("planted.yaml", "out"), first([]))
    mute = first([])._replace(driver=made_to_fail())
    (planted / "planted.yaml").write_text(CONFIG)
    with pytest.raises(RunError, match="mute: its process ended with exit code 1 before a case"):
        worker.run(api.sweep("planted.yaml", "out"), mute)


def made_to_fail():
    from freepath.device.drivers import Driver

    return Driver("mute", "A driver", "", (), lambda: "yes", prefix=(sys.executable, "-c", "1/0"))


class _Removing:
    """Removes a file of the folder at the second row."""

    def __init__(self, path):
        self.path, self.rows = path, 0

    def __call__(self, row):
        self.rows += 1
        if self.rows == 2:
            self.path.unlink()


@pytest.mark.parametrize("name", [".lock", "summary.csv", "samples.csv"])
def test_a_file_that_is_removed_under_way(planted, device, name):
    sweep = api.sweep("planted.yaml", "out", devices=[device])
    sweep.listener.row = removing = _Removing(planted / "out" / name)
    with pytest.raises(ResultError, match=rf"out/{name}: was removed while a run writes there"):
        sweep.run()
    assert removing.rows == 2
    if name != "summary.csv":
        assert len(rows()) == 2


def test_a_folder_that_is_removed_under_way(planted, device):
    sweep = api.sweep("planted.yaml", "out", devices=[device])
    sweep.listener.row = lambda row: shutil.rmtree(planted / "out", ignore_errors=True)
    with pytest.raises(ResultError, match="was removed while a run writes there"):
        sweep.run()


def test_a_full_disk(command, work):
    limited = ["bash", "-c", 'ulimit -f 2; trap "" XFSZ; exec "$@"', "-", *command]
    done = ended(limited, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"})
    assert done.returncode == 8
    assert "File too large" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("name", ["summary.csv", "samples.csv", "run.json", ".lock"])
def test_a_link_in_a_folder_from_somebody_else_is_not_followed(planted, device, name):
    api.sweep("planted.yaml", "out", devices=[device]).run()
    victim = planted / "victim"
    path = planted / "out" / name
    victim.write_text(path.read_text() if path.exists() else "mine")
    before = victim.read_bytes()
    path.unlink(missing_ok=True)
    path.symlink_to(victim)
    sweep = api.sweep(
        "planted.yaml", "out", axes=["tracker=delta,ratio,analytic"], devices=[device], resume=True
    )
    if name == ".lock":
        with pytest.raises(results.FreepathError, match="is a symbolic link"):
            sweep.run()
    else:
        sweep.run()
        assert not path.is_symlink()
    assert victim.read_bytes() == before
    for part in ("summary.csv.part", "run.json.part", "samples.csv.part"):
        assert not (planted / "out" / part).exists()


def test_a_report_and_a_picture_replace_a_link(planted, device, tmp_path):
    api.sweep("planted.yaml", "out", devices=[device]).run()
    victim = planted / "victim"
    victim.write_text("mine")
    report = planted / "out" / "report.md"
    report.symlink_to(victim)
    writing.write([planted / "out"], None, "md")
    assert "delta" in report.read_text()
    base = tmp_path / "pictures" / "one"
    base.parent.mkdir()
    for name in ("one.exr", "one.part.exr", "one.png", "one.part.png"):
        base.with_name(name).symlink_to(victim)
    pixels = np.ones((2, 2, 1))
    pictures.write_exr(base, pixels, pixels, {})
    pictures.write_mean(base, pixels, {})
    assert pictures.read_exr(base.with_name("one.exr"))[1]["mean"].shape == (2, 2, 1)
    assert victim.read_text() == "mine"
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "pictures" / "equal-time").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(results.FreepathError, match="equal-time is a symbolic link"):
        pictures.write_exr(tmp_path / pictures.EQUAL_TIME / "one", pixels, pixels, {})
