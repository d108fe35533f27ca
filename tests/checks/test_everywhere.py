"""`freepath check -d all`: every driver's checks in its process, told together."""

import dataclasses
import re
import sys
from xml.etree import ElementTree

import pytest

from freepath.checks import everywhere, worker
from freepath.checks.model import TINY, Check
from freepath.checks.outcome import Outcome
from freepath.cli import main
from freepath.device import drivers, selection, trial
from freepath.device.drivers import Driver
from freepath.device.selection import Part
from freepath.errors import DriverLimitError

pytestmark = pytest.mark.slow

READS_NOTHING = """/*---
title: A tracker that reads what nobody has written
estimands: [transmittance]
needs: [majorant]
---*/
static void begin(Path *path, const Scene *scene, Rng *rng) { walk_begin(path, scene); }
static void step(Path *path, const Scene *scene, Rng *rng)
{
    float unset;
    if (unset > 3.0f)
        path->weight = (real)0;
    const mask here = next_tentative(path, scene, rng);
    const real sigma = sigma_t_at_tentative(path, scene, here);
    collide(path, here & less(uniform(rng) * path->majorant, sigma));
}
"""


@pytest.fixture
def there():
    found = list(trial.of_installed())
    if len(found) < 2:
        pytest.skip("fewer than two drivers are installed")
    return found


def test_all_drivers(there, work, capfd):
    arguments = ["-R", "^smoke/delta$", "--output-junit", "junit.xml"]
    assert main(["check", "-d", "all", *arguments]) == 0
    out = capfd.readouterr().out
    assert out.count("100% tests passed, 0 tests failed out of 1") >= len(there)
    assert re.search(rf"^smoke/delta +{' '.join('P' * len(there))}", out, re.M)
    suites = ElementTree.parse("junit.xml").getroot()
    assert len(suites) >= len(there)


def test_a_driver_that_dies_takes_no_other_with_it(monkeypatch, work, capfd):
    crash = (sys.executable, "-c", "import os; os.abort()")
    dying = Driver("dying", "A driver", "Maker", (), lambda: "yes", prefix=crash)
    fine = selection.default()
    monkeypatch.setattr(selection, "resolve", lambda _: [Part(dying, fine.infos), fine])
    assert main(["check", "-d", "all", "-R", "^hard/bad-input/nan$"]) == 8
    out, err = capfd.readouterr()
    assert "dying: its process was ended by SIGABRT" in err
    assert "100% tests passed, 0 tests failed out of 1" in out


def test_an_interpreter_has_its_say(work, capfd):
    if drivers.BY_NAME["oclgrind"].missing:
        pytest.skip("Oclgrind is not installed")
    folder = work / "trackers"
    folder.mkdir()
    (folder / "careless.cl").write_text(READS_NOTHING)
    arguments = ["-d", "oclgrind", "--trackers", str(folder), "--output-on-failure", "-j", "2"]
    wanted = "^smoke/(careless|ratio)$|^identity/careless/transmittance/homogeneous"
    assert main(["check", *arguments, "-R", wanted]) == 8
    out = capfd.readouterr().out
    assert "depends on uninitialized value" in out
    assert "50% tests passed, 1 tests failed out of 2" in out
    assert "an interpreter gets checks with the label tiny" in out
    assert main(["check", "--trackers", str(folder), "-d", "oclgrind", "--rerun-failed"]) == 8
    assert "0% tests passed, 1 tests failed out of 1" in capfd.readouterr().out


def test_outcomes_are_handed_on(tmp_path):
    outcomes = {"a": [Outcome(1, "x", ("fast",), "Failed", 0.5, "why", 2, p_value=1e-9)]}
    everywhere.write(tmp_path / "file", outcomes, ["b: gone"])
    assert everywhere.read(tmp_path / "file") == (outcomes, ["b: gone"])


def test_what_a_device_cannot_do_is_no_failure(rig, monkeypatch):
    def limited(*_):
        raise DriverLimitError("loops end")

    check = Check("x", ("fast",), "Why.", limited)
    plain = dataclasses.replace(rig.device.info, interpreted=False, loop_limit=0)
    monkeypatch.setattr(rig.device, "info", plain)
    assert worker.run(rig, check)[::2] == ("Failed", "loops end")
    monkeypatch.setattr(rig.device, "info", dataclasses.replace(plain, loop_limit=65535))
    assert worker.run(rig, check)[::2] == ("Skipped", "loops end")
    slow = dataclasses.replace(plain, interpreted=True)
    assert "interpreter" in check.reason_against(slow)
    assert not dataclasses.replace(check, labels=("fast", TINY)).reason_against(slow)


def test_another_arithmetic_is_that_of_flights_that_name_none(rig):
    """And what is built with it is another program."""
    axes = {"tracker": "ratio", "estimand": "transmittance", "medium": "homogeneous", "lanes": 1}
    fast = rig.with_arithmetic("fast")
    assert "-cl-fast-relaxed-math" in fast.flight(**axes).runner.program.source.options
    named = fast.flight(**axes, arithmetic="strict").runner.program.source.options
    assert named == rig.flight(**axes).runner.program.source.options
