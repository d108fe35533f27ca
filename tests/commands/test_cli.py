import dataclasses
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time

import pytest

from freepath import cli
from freepath.commands.listing import LISTS
from freepath.device import drivers, selection, trial
from freepath.device.drivers import Driver
from freepath.device.selection import Part
from freepath.results.folder import read_rows

SWEEP = """\
name: small
rays: {orthographic: {resolution: [4, 4]}}
matrix: {medium: {homogeneous: {sigma_t: 1}}, tracker: [regular, analytic]}
stop: {samples: 20}
"""


@pytest.fixture
def call(work, capsys):
    """Run a command in a folder with small.yaml; returns exit code, output and errors."""
    (work / "small.yaml").write_text(SWEEP)

    def call(*arguments):
        try:
            code = cli.main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = stop.code
        printed = capsys.readouterr()
        assert "Traceback" not in printed.err
        return code, printed.out, printed.err

    return call


def command(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "freepath", *arguments],
        check=False,
        capture_output=True,
        text=True,
        **options,
    )


@pytest.mark.parametrize("words", [[], ["run"], ["list"], ["devices"], ["source"]])
def test_help(call, words):
    code, out, _ = call(*words, "--help")
    assert code == 0
    assert out.startswith("usage: freepath")
    if not words:
        assert "exit codes: 0 fine; 1 a regression; 2 usage or config; 5 nothing matched" in out
        for name in ("run", "list", "devices", "source"):
            assert re.search(rf"^ +{name} +\w", out, re.MULTILINE)


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["fly"],
        ["run"],
        ["run", "small.yaml", "--speed"],
        ["run", "small.yaml", "--res"],
        ["run", "small.yaml", "-d"],
        ["list", "clouds"],
        ["source", "small.yaml", "--case", "two"],
    ],
)
def test_usage(call, words):
    code, out, err = call(*words)
    assert (code, out) == (2, "")
    assert err.startswith("usage: freepath")
    assert "error:" in err


MISTAKES = [
    ("nope", "nope: expected a config file or the name of one that comes with freepath"),
    ("quik", "did you mean 'quick'?"),
    (".", ".: expected a file, got a directory"),
    ("small.yaml -d zzz", "no OpenCL device matches 'zzz'; -d takes\n  "),
    ("small.yaml -d ''", "no OpenCL device matches ''"),
    ("small.yaml -a speed=1", "-a speed=1: unknown axis 'speed'"),
    ("small.yaml -a tightness=x", "expected a number > 0, got 'x'"),
    ("small.yaml -R (", "-R (: expected a regular expression"),
    ("small.yaml --trackers nowhere", "nowhere: expected a folder with .cl files, got none"),
    ("small.yaml --trackers bad", "bad/mine.cl:1:1: expected front matter"),
    ("small.yaml --resume", "no run of small in results/ to resume"),
    ("small.yaml --resume -o nothing", "nothing: holds no run to resume"),
    ("small.yaml -o small.yaml", "small.yaml: is a file, expected a folder"),
    ("small.yaml -o small.yaml/x", "small.yaml/x: cannot be written to: Not a directory"),
    ("small.yaml -o full", "full: already holds summary.csv"),
    ("small.yaml -a 'medium={volume: {file: no.npy}}'", "no.npy: no such file in "),
    ("small.yaml -a 'medium={volume: {file: small.yaml}}'", "small.yaml: "),
]


@pytest.mark.parametrize(("words", "message"), MISTAKES)
def test_mistakes(call, work, selector, words, message):
    (work / "bad").mkdir()
    (work / "bad" / "mine.cl").write_text("int x;")
    (work / "full").mkdir()
    (work / "full" / "summary.csv").write_text("")
    before = sorted(work.rglob("*"))
    words = shlex.split(words)
    given = [] if "-d" in words else ["-d", selector]
    code, out, err = call("run", *words, *given)
    assert (code, out) == (2, "")
    assert err.startswith("freepath: ")
    assert message in err
    assert sorted(work.rglob("*")) == before  # nothing is left behind


def test_a_mistake_in_a_config_is_shown_where_it_is(call, work):
    (work / "small.yaml").write_text(SWEEP.replace("regular", "regulr"))
    code, _, err = call("run", "small.yaml")
    assert code == 2
    assert "small.yaml:3:" in err
    assert "did you mean 'regular'?" in err
    assert "^" in err


def test_nothing_matched(call):
    assert call("run", "small.yaml", "-R", "nothing")[0] == 5
    assert call("run", "small.yaml", "-E", ".")[0] == 5
    code, _, err = call("source", "small.yaml", "--case", "999")
    assert code == 5
    assert err == "freepath: no case 999 among 2; see `freepath run small.yaml -N`\n"


def test_no_opencl_at_all(call, monkeypatch):
    monkeypatch.delenv("FREEPATH_DEVICE", raising=False)
    absent = Driver("absent", "A driver", "Maker", ("pip install it",), lambda: "")
    crash = (sys.executable, "-c", "import os; os.abort()")
    dying = Driver("dying", "A driver", "Maker", (), lambda: "yes", prefix=crash)
    monkeypatch.setattr(drivers, "DRIVERS", (absent, dying))
    monkeypatch.setattr(drivers, "strangers", dict)
    reasons = "dying: its process was ended by SIGABRT", "absent: not installed; `make devices`"
    for words in (["run", "small.yaml"], ["check"], ["source", "small.yaml", "--case", "1"]):
        code, out, err = call(*words)
        assert (code, out) == (2, "")
        assert err.startswith("freepath: no OpenCL driver works here:\n")
        assert all(reason in err for reason in reasons)
    code, out, err = call("devices")
    assert code == 0
    assert "no OpenCL driver works here" in err
    assert all(text in " ".join(out.split()) for text in ("ended by SIGABRT", "pip install it"))
    assert call("run", "small.yaml", "-N")[0] == 0


def test_cases_are_listed_without_running(call, work):
    code, out, _ = call(
        "run", "small.yaml", "-N", "-a", "tightness=1,2", "-a", "tracker=delta,regular"
    )
    assert code == 0
    assert out.splitlines() == [
        "    1  transmittance/homogeneous-1/global/t1/delta/auto/strict",
        "    2  transmittance/homogeneous-1/regular/auto/strict",
        "    3  transmittance/homogeneous-1/global/t2/delta/auto/strict",
        "",
        "3 cases",
    ]
    assert sorted(path.name for path in work.iterdir()) == ["small.yaml"]


def test_cases_as_json(call):
    code, out, _ = call("run", "small.yaml", "-N", "--json", "-E", "analytic")
    assert code == 0
    (case,) = json.loads(out)
    assert case["name"] == "transmittance/homogeneous-1/regular/auto/strict"
    assert case["medium"] == {
        "homogeneous": {
            "channels": None,
            "albedo": [0.0],
            "emission": [0.0],
            "phase": "henyey_greenstein",
            "g": 0.0,
            "sigma_t": 1.0,
            "size": [1.0, 1.0, 1.0],
        }
    }


def test_a_run_prints_a_table_and_names_its_files(call, work, selector, device):
    code, out, err = call("run", "small.yaml", "-d", selector)
    assert (code, err) == (0, "")
    (folder,) = (work / "results").iterdir()
    assert device.info.name in out
    assert "load" in out
    assert re.search(r"^analytic +~0 ", out, re.MULTILINE)
    assert re.search(
        r"device time \d+ % of [\d.]+ s outside compilation; compilation [\d.]+ s", out
    )
    for name in ("summary.csv", "samples.csv", "run.json"):
        assert f"wrote results/{folder.name}/{name}" in out
    # the newest run of the config is gone on with
    assert call("run", "small.yaml", "-d", selector, "--resume")[0] == 0
    assert len(list((work / "results").iterdir())) == 1


def test_a_run_as_json_prints_nothing_else(call, selector):
    code, out, err = call("run", "small.yaml", "-d", selector, "--json", "-o", "out")
    assert code == 0
    rows = json.loads(out)
    assert [row["tracker"] for row in rows] == ["regular", "analytic"]  # in the order of the cases
    assert rows[0]["samples_per_ray"] == 20
    assert rows[0]["z_score"] is None
    assert "ok" in err


@pytest.mark.parametrize("what", LISTS)
def test_lists(call, what):
    code, out, _ = call("list", what)
    assert code == 0
    records = json.loads(call("list", what, "--json")[1])
    assert records
    for record in records:
        assert next(iter(record.values())) in out
    short = [line.split()[0] for line in call("list", what, "--short")[1].splitlines()]
    assert set(short) >= {next(iter(record.values())) for record in records}
    assert len(short) == len(records) or what == "configs"  # whose descriptions are long


def test_what_is_told_of_a_medium(call):
    out = call("list", "media")[1]
    assert "sigma_t (required): Mean extinction." in out
    assert "size = [1, 1, 1]: Sides of the box." in out
    assert "center (optional): Centre of the blob" in out


def test_trackers_are_what_is_listed_if_nothing_is_said(call):
    assert call("list") == call("list", "trackers")


def test_what_is_told_of_a_tracker(call, work):
    (work / "mine").mkdir()
    text = """\
/*---
title: All [bold] of mine
estimands: [transmittance]
bounding: true
parameters:
  step: {unit: length, default: 0.5, above: 0, meaning: how far}
  way: {choices: [up, down], default: up}
---*/
static void begin(Path *path, const Scene *scene, Rng *rng) {}
static void step(Path *path, const Scene *scene, Rng *rng) {}
"""
    (work / "mine" / "mine.cl").write_text(text)
    out = call("list", "--trackers", "mine")[1]
    assert "All [bold] of mine" in out
    assert "step = 0.5: how far (a length > 0, such as 20 or 20 m)" in out
    assert "way = up: way (up or down)" in out
    (mine,) = (
        r
        for r in json.loads(call("list", "--trackers", "mine", "--json")[1])
        if r["tracker"] == "mine"
    )
    assert mine["majorant must bound"] is True
    assert mine["needs"] == "nothing"


@pytest.mark.slow
def test_devices(call, device):
    code, out, _ = call("devices")
    assert code == 0
    assert "lanes: 16" in out or device.info.lanes != 16
    records = json.loads(call("devices", "--json")[1])
    assert device.info.name in [record["device"] for record in records]
    assert {record["-d"] for record in records} >= {driver.name for driver in drivers.DRIVERS}
    for driver in drivers.DRIVERS:
        shown = [record for record in records if record["-d"] == driver.name]
        assert [record.get("missing") for record in shown] == [driver.missing or None]
        assert all(record["works"] is True for record in shown if "works" in record)
    (default,) = [record for record in records if record.get("default")]
    names = [record["-d"] for record in records if record.get("works") is True]
    assert default["-d"] == names[0], "the default is the first that works"


def test_a_run_on_all_devices_has_rows_and_a_table_of_each(call, work):
    """Each in its own process, into one folder."""
    code, out, err = call("run", "small.yaml", "-R", "regular", "-d", "all", "-o", "out")
    assert code == 0, err
    rows = read_rows(work / "out" / "summary.csv")
    there = list(trial.of_installed())
    owners = [drivers.owner(row["platform"], row["driver_version"]) for row in rows]
    assert owners[: len(there)] == there
    assert {row["status"] for row in rows} == {"ok"}
    assert out.count("transmittance of homogeneous") == len(rows)
    facts = json.loads((work / "out" / "run.json").read_text())
    assert len(facts["devices"]) == len(facts["cases"]) == len(facts["sessions"]) == len(rows)
    few = {row["platform"]: row["rays"] for row in rows}
    assert few.get("Oclgrind", "16") == "16"
    code, out, err = call("run", "small.yaml", "-R", "regular", "-d", "all", "-o", "out")
    assert code == 2
    assert "already holds" in err


DIES = """\
import os, sys
from freepath.measure import worker
from freepath.measure.sweep import Sweep
groups = Sweep.groups
Sweep.groups = lambda sweep, jobs: [[job] for group in groups(sweep, jobs) for job in group]
run = Sweep._run
def once(sweep, jobs):
    run(sweep, jobs)
    sweep.state[1] = -1
    os.abort()
Sweep._run = once
worker.main(sys.argv[4:])
"""


def test_what_a_driver_that_crashed_did_not_finish_is_told(call, work, monkeypatch):
    there = drivers.installed()
    if not there:
        pytest.skip("no known driver is installed")
    infos = selection.resolve([there[0].name])[0].infos
    dying = dataclasses.replace(there[0], prefix=(sys.executable, "-c", DIES))
    mute = Driver("mute", "A driver", "", (), lambda: "yes", prefix=(sys.executable, "-c", "1/0"))
    idle = Driver("idle", "A driver", "", (), lambda: "yes")
    parts = [Part(idle, [], "it hangs"), Part(mute, infos), Part(dying, infos)]
    monkeypatch.setattr(selection, "resolve", lambda _: parts)
    monkeypatch.setattr(selection, "checked", lambda parts: parts)
    code, out, err = call("run", "small.yaml", "-d", "all", "-o", "out")
    assert code == 8
    assert "mute: its process ended with exit code 1" in err
    assert "idle cannot be used here: it hangs" in err
    assert "mute: 2 of 2 cases were not finished on " in err
    assert f"{dying.name}: its process was ended by SIGABRT before a case was at work" in err
    assert f"{dying.name}: 1 of 2 cases were not finished on " in err
    (row,) = read_rows(work / "out" / "summary.csv")
    left = next(name for name in ("regular", "analytic") if name != row["tracker"])
    assert re.search(rf"not finished on .*: [^,]*/{left}/[^,]*$", err, re.MULTILINE)
    assert "same command and -o out --resume" in err
    assert row["case"].split("/")[1] in out
    # and nothing at all is no result, nor a mistake of the user's
    parts[:] = [Part(mute, infos)]
    assert call("run", "small.yaml", "-d", "all", "-o", "none")[0] == 8


def test_the_source_of_a_case(call, selector):
    code, out, _ = call("source", "small.yaml", "--case", "2", "-d", selector)
    assert code == 0
    assert '#line 1 "main.cl"' in out
    assert "trackers/analytic.cl" in out
    assert call("source", "small.yaml", "-R", "analytic", "-d", selector)[1] == out
    code, _, err = call("source", "small.yaml")
    assert code == 2
    assert "expected --case N: 2 cases match" in err


def test_a_skipped_case_has_no_source(call):
    code, out, err = call(
        "source",
        "small.yaml",
        "-a",
        "medium={exponential: {sigma_t: 1, scale_height: 1}}",
        "-R",
        "regular",
    )
    assert (code, out) == (2, "")
    assert "has no source: regular needs cells" in err


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion(call, shell):
    code, out, _ = call("--print-completion", shell)
    assert code == 0
    assert "freepath" in out
    assert "--resume" in out


@pytest.mark.parametrize(
    "words", [["--help"], ["list"], ["list", "configs"], ["--print-completion", "bash"]]
)
def test_what_needs_no_device_loads_none(words):
    script = (
        "import sys; from freepath.cli import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit: pass\n"
        "heavy = {'pyopencl', 'scipy', 'numpy', 'OpenImageIO', 'pint'} & set(sys.modules)\n"
        "sys.exit(f'loads {heavy}' if heavy else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *words], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_a_module_too():
    done = command("--version")
    assert done.returncode == 0
    assert done.stdout.startswith("freepath ")


@pytest.mark.parametrize("words", ["list", "run quick -N"])
def test_a_reader_that_has_seen_enough(words):
    script = f"{sys.executable} -m freepath {words} | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", script], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


# regular has no variance and is done at once; delta would take all the time that it is given
LONG = SWEEP.replace("{samples: 20}", "{at_most: 40 s, error: 0.0001%, time_noise: 100%}")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_run_can_be_completed(call, work, selector, number):
    (work / "long.yaml").write_text(LONG)
    given = ["run", "long.yaml", "-d", selector, "-o", "out"]
    running = subprocess.Popen(
        [sys.executable, "-m", "freepath", *given, "-a", "tracker=regular,delta"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    try:
        assert "regular" in running.stdout.readline()
        before = (work / "out" / "summary.csv").read_bytes()
        time.sleep(0.3)
        running.send_signal(number)
        _, err = running.communicate(timeout=30)
    finally:
        running.kill()
    assert running.returncode == 130
    assert err == (
        "freepath: interrupted with 1 of 2 cases done; "
        "go on with the same command and -o out --resume\n"
    )
    assert (work / "out" / "summary.csv").read_bytes() == before
    assert not (work / "out" / ".lock").exists()
    assert (
        json.loads((work / "out" / "run.json").read_text())["sessions"][0]["ended"] == "interrupted"
    )
    (work / "long.yaml").write_text(LONG)
    code, _, _ = call(*given, "--resume", "-a", "tracker=regular")
    assert code == 0
    assert (work / "out" / "summary.csv").read_bytes() == before
    assert len(read_rows(work / "out" / "summary.csv")) == 1


def test_a_terminal_without_a_plus_minus_and_a_full_disk(work, selector):
    (work / "x.yaml").write_text(
        "name: x\nmatrix: {medium: {homogeneous: {sigma_t: 1}}, tracker: delta}\n"
        "rays: {orthographic: {resolution: 2}}\nstop: {samples: 20}\n"
    )
    command = [sys.executable, "-m", "freepath", "run", "x.yaml", "-d", selector, "-o"]
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        [*command, "a"], env=ascii_only, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "\\xb1" in done.stdout
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*command, "b"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (done.returncode, done.stderr) == (8, "freepath: writing: No space left on device\n")
    assert (work / "b" / "summary.csv").exists()
