import os
import sys

import pytest

from freepath.device import drivers, trial
from freepath.device.drivers import Driver
from freepath.device.trial import Outcome
from freepath.extras import device_setup
from freepath.extras.device_setup import command_of, install, obstacle


def made_up(get, found=""):
    return Driver("made-up", "A driver", "Maker", (get,), lambda: found)


def test_commands():
    assert command_of("pip install a b")[:4] == [sys.executable, "-m", "pip", "install"]
    assert command_of("apt-get install c") == ["apt-get", "install", "-y", "-qq", "c"]


def test_what_cannot_be_tried_says_why(monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(device_setup.shutil, "which", lambda name: f"/usr/bin/{name}")
    assert obstacle("apt-get install c") == "apt-get needs root"
    assert obstacle("pip install a") == ""
    monkeypatch.setattr(device_setup.shutil, "which", lambda name: None)
    assert obstacle("apt-get install c") == "there is no apt-get here"


def test_what_fails_says_why(monkeypatch):
    quick = [sys.executable, "-c"]
    assert device_setup.run([*quick, "pass"]) == ""
    assert device_setup.run([*quick, "print('a'); print('E: no such package'); exit(1)"]) == (
        "E: no such package"
    )
    assert device_setup.run([*quick, "exit(3)"]) == "exit code 3"
    assert "no-such-program" in device_setup.run(["no-such-program"])
    monkeypatch.setattr(device_setup, "run", lambda command: "no network")
    assert install(made_up("pip install a")) == "`pip install a`: no network"
    monkeypatch.setattr(device_setup, "run", lambda command: "")
    assert install(made_up("pip install a")) == "was installed and is still not found"
    assert install(made_up("pip install a", found="there")) == ""


@pytest.mark.parametrize("works", [True, False])
def test_what_is_missing_is_said_and_the_others_are_still_there(monkeypatch, capsys, device, works):
    missing = made_up("pip install a", found="there" if works else "")
    monkeypatch.setattr(drivers, "DRIVERS", (missing, made_up("pip install b", found="there")))
    fine = Outcome((device.info,), ("",))
    monkeypatch.setattr(trial, "outcomes", lambda wanted, afresh: [fine for _ in wanted])
    monkeypatch.setattr(device_setup, "run", lambda command: "no network")
    monkeypatch.setattr(sys, "argv", ["device_setup"])
    assert device_setup.main() == (0 if works else 8)
    out, err = capsys.readouterr()
    assert out.count(device.info.label) == (2 if works else 1)
    assert ("MISSING: `pip install a`: no network" in err) != works


def test_intel_s_runtime_is_installed_only_where_nothing_works(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["device_setup", "--if-needed"])
    installed = []
    monkeypatch.setattr(device_setup, "install", lambda driver: installed.append(driver.name) or "")
    assert device_setup.main() == 0
    assert (installed, capsys.readouterr().out) == ([], "")
    monkeypatch.setattr(drivers, "DRIVERS", (made_up("pip install a"),))
    monkeypatch.setattr(drivers, "strangers", dict)
    assert device_setup.main() == 0
    out = capsys.readouterr().out
    assert installed == ["intel"]
    assert "made-up: not installed" in out
    assert "270 MB, under Intel's licence" in out
    monkeypatch.setattr(device_setup, "install", lambda driver: "no network")
    assert device_setup.main() == 8
    assert "MISSING: no network" in capsys.readouterr().err
