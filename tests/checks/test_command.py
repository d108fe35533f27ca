"""`freepath check`: selection, text, files, exit codes, crashes and timeouts."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from xml.etree import ElementTree

import pytest

from freepath.checks import files, printing
from freepath.checks.model import Check
from freepath.checks.outcome import Outcome
from freepath.checks.pool import Pool, Task
from freepath.checks.worker import Setting
from freepath.cli import main

QUICK = "^hard/bad-input/(nan|negative|text)$"
BROKEN = """/*---
title: A tracker that forgets to look anything up
estimands: [transmittance]
needs: [majorant]
---*/
static void begin(Path *path, const Scene *scene, Rng *rng) { walk_begin(path, scene); }
static void step(Path *path, const Scene *scene, Rng *rng) { escape(path, path->live); }
"""


@pytest.fixture
def call(work, capsys):
    def call(*arguments):
        code = main(["check", *arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


def test_listed(call):
    code, out, _ = call("-N", "-V", "-R", QUICK)
    assert code == 0
    assert re.search(r"Labels: fast hard bad-input tiny\n  Test +#\d+: hard/bad-input/nan\n", out)
    assert "refused" in out
    assert out.endswith("Total Tests: 3\n")


def test_passed(call, selector):
    code, out, _ = call("-d", selector, "-R", QUICK, "-j", "2", "--output-junit", "junit.xml")
    assert code == 0
    assert re.search(r"^      Start +\d+: hard/bad-input/nan$", out, re.M)
    assert re.search(
        r"^3/3 Test +#\d+: hard/bad-input/\w+ \.+   Passed   +\d+\.\d\d sec$", out, re.M
    )
    assert "100% tests passed, 0 tests failed out of 3" in out
    (suite,) = ElementTree.parse("junit.xml").getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("3", "0")


def test_a_report_that_cannot_be_written_is_told_first(call, selector, work):
    (work / "file").write_text("")
    code, out, err = call("-d", selector, "-R", QUICK, "--output-junit", "file/junit.xml")
    assert code == 2
    assert "file/junit.xml: cannot be written" in err
    assert "Start" not in out


def test_a_report_of_many_repeats(tmp_path):
    """Each outcome is counted once, not again for every one that follows."""
    names = [f"check-{number}" for number in range(1000)]
    outcomes = [Outcome(1, n, ("fast",), "Passed", 0.1, repeat=r) for r in range(20) for n in names]
    started = time.process_time()
    files.write_junit(tmp_path / "junit.xml", {"device": outcomes})
    assert time.process_time() - started < 20.0
    (suite,) = ElementTree.parse(tmp_path / "junit.xml").getroot()
    assert suite.get("tests") == "20000"
    assert len({case.get("name") for case in suite}) == 20000


@pytest.fixture
def broken(tmp_path):
    folder = tmp_path / "trackers"
    folder.mkdir()
    (folder / "broken.cl").write_text(BROKEN)
    return str(folder)


def test_failed_and_run_again(call, selector, broken):
    """A tracker from elsewhere has the checks that its front matter calls for."""
    arguments = ["-d", selector, "--trackers", broken]
    wanted = "^identity/broken/transmittance/(homogeneous|linear)|^hard/bad-input/nan$"
    code, out, err = call(
        *arguments, "-R", wanted, "--output-on-failure", "--output-junit", "j.xml"
    )
    assert code == 8
    assert "33% tests passed, 2 tests failed out of 3" in out
    assert re.search(r"identity/broken/transmittance/linear/\w+ \.+\*\*\*Failed", out)
    assert "times the bound" in out or "mean:" in out
    assert re.search(r"The following tests FAILED:\n\t *\d+ - identity/broken/", out)
    (suite,) = ElementTree.parse("j.xml").getroot()
    assert suite.get("failures") == "2"
    code, out, _ = call(*arguments, "--rerun-failed", "--stop-on-failure")
    assert code == 8
    assert "0% tests passed, 1 tests failed out of 1" in out
    code, _, err = call("--rerun-failed", "-R", "nan")
    assert (code, "no tests matched" in err) == (5, True)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["-R", "no such check"], 5, "no tests matched"),
        (["-L", "("], 2, "expected a regular expression"),
        (["-d", "no such device", "-R", "nan"], 2, "no OpenCL device matches"),
        (["--rerun-failed"], 2, "no run before"),
        (["--ctest", "/dev/null/x"], 2, "cannot be written"),
    ],
)
def test_mistakes(call, arguments, code, message):
    found, _, err = call(*arguments)
    assert found == code
    assert message in err


@pytest.mark.parametrize("arguments", [["-j", "0"], ["--timeout", "0"], ["--seed", "-1"]])
def test_wrong_numbers(call, arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        call(*arguments)
    assert stopped.value.code == 2
    assert "expected" in capsys.readouterr().err


def test_repeated_with_fresh_seeds(call, selector):
    arguments = ["-R", "^hard/random-numbers/disjoint/16", "--repeat", "3", "--seed", "5"]
    code, out, _ = call("-d", selector, *arguments)
    assert code == 0
    assert "0 of 3 runs with fresh seeds raised an alarm" in out
    assert "the budget is 0.001 a run" in out
    assert "None of these checks tests a distribution." in out


def test_what_fails_in_a_repeat_fails_again_with_its_seed(call, selector, broken):
    arguments = ["-d", selector, "--trackers", broken, "-R", "^identity/broken/.*homogeneous"]
    code, out, _ = call(*arguments, "--repeat", "3", "--seed", "5", "--output-on-failure")
    assert code == 8
    said = dict(re.findall(r"    --seed (\d+): (.*)", out))
    assert list(said) == ["1000008", "2000011"]
    assert len(set(said.values())) == 2
    assert len(re.findall(r"^\t.* - identity/broken.*\(Failed\), 3 times$", out, re.M)) == 1
    _, alone, _ = call(*arguments, "--seed", "1000008", "--output-on-failure")
    assert said["1000008"] in alone


def test_repeats_that_are_interrupted_tell_what_they_know(tmp_path, selector):
    command = ["check", "-d", selector, "-R", "^inversion/analytic/", "--repeat", "100000"]
    running = subprocess.Popen(
        [sys.executable, "-m", "freepath", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    try:
        while "Passed" not in running.stdout.readline():
            pass
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=60)
    finally:
        running.kill()
    assert running.returncode == 130
    assert err == "freepath: interrupted\n"
    assert "stopped, so no run is whole and the rate of false alarms is unknown.\n" in out
    assert re.search(r"^0 of \d+ verdicts were alarms\.$", out, re.M)
    assert "of 100000 runs" not in out


def test_repeats_that_stop_at_a_failure_tell_no_rate(call, selector, broken):
    arguments = ["-d", selector, "--trackers", broken, "-R", "^identity/broken/.*homogeneous"]
    code, out, _ = call(*arguments, "--repeat", "50", "--stop-on-failure")
    assert code == 8
    assert "stopped, so no run is whole and the rate of false alarms is unknown.\n" in out
    assert "of 50 runs" not in out


def test_a_repeat_that_failed_is_in_the_matrix():
    runs = [
        Outcome(1, "x", (), status, 0.0, "off", i) for i, status in enumerate(["Failed", "Passed"])
    ]
    assert re.search("^x +F$", printing.matrix({"one": runs}), re.M)


def test_matrix():
    text = printing.matrix(
        {
            "one": [Outcome(1, "x", (), "Passed", 0.0), Outcome(2, "y", (), "Failed", 0.0, "off")],
            "two": [Outcome(1, "x", (), "Skipped", 0.0, "no doubles")],
        }
    )
    assert "x      P -" in text
    assert "y      F ?" in text
    assert "no doubles: B x" in text


@pytest.mark.skipif(not shutil.which("ctest"), reason="ctest is not installed")
def test_ctest_runs_them(call, selector, tmp_path):
    code, out, _ = call("--ctest", str(tmp_path / "c"), "-R", QUICK, "-d", selector)
    assert code == 0
    found = subprocess.run(
        ["ctest", "-L", "bad-input", "-j", "2"],
        cwd=tmp_path / "c",
        capture_output=True,
        text=True,
        check=False,
    )
    assert "100% tests passed, 0 tests failed out of 3" in found.stdout
    assert found.returncode == 0


def crash(*_):
    os.kill(os.getpid(), signal.SIGSEGV)


def hang(*_):
    time.sleep(60)


@pytest.mark.parametrize(("doing", "status"), [(crash, "Crashed"), (hang, "Timeout")])
def test_a_check_that_takes_its_process_with_it(monkeypatch, selector, tmp_path, doing, status):
    """The others are run all the same, by another process, and nothing is left behind."""
    monkeypatch.setattr("freepath.checks.pool._serve", serve_badly)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    tasks = [
        Task(i, Check(name, (), "", doing), 0) for i, name in enumerate([doing.__name__, "ok"])
    ]
    pool = Pool(Setting(selector), 1, 5.0, lambda task: None)
    outcomes = {one.name: one for one in pool.outcomes(tasks)}
    assert outcomes[doing.__name__].status == status
    assert outcomes["ok"].status == "Passed"
    if status == "Crashed":
        assert "SIGSEGV" in outcomes["crash"].text
    assert not list(tmp_path.iterdir())


def serve_badly(connection, setting, folder):
    (folder / "case.yaml").touch()
    connection.send("")
    while (task := connection.recv()) is not None:
        {"crash": crash, "hang": hang}.get(task[0], lambda: None)()
        connection.send(("Passed", 0.0, ""))
