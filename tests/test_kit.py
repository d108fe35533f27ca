"""The kit: made from this tree, and tried as on a machine without a package index."""

import os
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
MAKE = ROOT / "packaging" / "make_kit.py"


@pytest.fixture(scope="module")
def kit(tmp_path_factory):
    """A kit without the wheels of others: what it needs is there, as on many a cluster."""
    pytest.importorskip("setuptools", minversion="77", reason="what pyproject.toml builds with")
    folder = tmp_path_factory.mktemp("kit") / "kit"
    command = [sys.executable, str(MAKE), str(folder), "--own-only"]
    made = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert made.returncode == 0, made.stdout + made.stderr
    return folder


def tried(kit, folder, steps, *arguments, **variables):
    """Run it in an environment with nothing in it: exit code, what it printed, its results."""
    wanted = {
        "PATH": "/usr/bin:/bin",
        "HOME": str(folder / "no-home"),
        "PIP_NO_INDEX": "1",
        "FREEPATH_PYTHON": sys.executable,
        "FREEPATH_KIT_SECONDS": "900",
        "FREEPATH_KIT_STEPS": steps,
        **variables,
    }
    command = [str(kit / "run.sh"), *arguments]
    done = subprocess.run(
        command, cwd=folder, env=wanted, capture_output=True, text=True, check=False, timeout=600
    )
    results = [path for path in folder.glob("results-*") if path.is_dir()]
    return done.returncode, done.stdout + done.stderr, results[0] if results else None


def test_what_is_in_it(kit):
    names = {path.relative_to(kit).as_posix() for path in kit.rglob("*") if path.is_file()}
    (wheel,) = (name for name in names if name.endswith(".whl"))
    others = {"README.md", "run.sh", "requirements.txt", "python-version"}
    assert names == others | {wheel}
    assert "freepath/kernels/main.cl" in zipfile.ZipFile(kit / wheel).namelist()
    needed = (kit / "requirements.txt").read_text().split()
    assert {re.split("[<>=]", one)[0] for one in needed} >= {"numpy", "scipy", "pyopencl", "rich"}
    assert not [one for one in needed if re.match("openimageio|altair|vl-convert", one.lower())]
    assert os.access(kit / "run.sh", os.X_OK)
    assert subprocess.run(["bash", "-n", kit / "run.sh"], check=False).returncode == 0


def test_every_step_that_the_readme_names_is_there(kit):
    text, readme = (kit / "run.sh").read_text(), (kit / "README.md").read_text()
    assert re.findall(r"^  step ([a-z-]+) ", text, re.M) == [
        "devices",
        "check-tiny",
        "run-quick",
        "run-lanes",
        "check-identity",
    ]
    # all but the last fit into the time that there is, with some of it for setting up
    limits = dict(re.findall(r'^ +step "?([a-z-]+)(?:\$group")? ([0-9]+) ', text, re.M))
    limits = {
        name: int(limit) * (4 if name.endswith("-in-") else 1) for name, limit in limits.items()
    }
    assert len(limits) == 6
    assert sum(limits.values()) - limits["check-identity"] <= 345 - 40
    for name in set(re.findall(r"\b(?:FREEPATH_[A-Z_]+|TMPDIR)\b", text)) - {"FREEPATH_CACHE"}:
        assert f"`{name}`" in readme


def test_it_sets_up_and_finds_a_driver_without_an_icd_file(kit, tmp_path):
    hidden, vendors = tmp_path / "hidden", tmp_path / "vendors"
    hidden.mkdir()
    vendors.mkdir()
    (hidden / "libnvidia-opencl.so.1").write_bytes(b"no library")
    (vendors / "kept.icd").write_text("libkept.so.1\n")
    code, printed, results = tried(
        kit, tmp_path, "devices", OCL_ICD_VENDORS=str(vendors), LD_LIBRARY_PATH=str(hidden)
    )
    assert code == 0, printed
    assert re.search(r"^passed   set-up \(\d+ s\)$", printed, re.M)
    assert re.search(r"^passed   devices \(\d+ s\)$", printed, re.M)
    assert "Looking in indexes" not in (results / "set-up.log").read_text()
    described = (results / "machine.log").read_text()
    assert f"./libnvidia-opencl.icd:{hidden}/libnvidia-opencl.so.1" in described
    assert "./kept.icd:libkept.so.1" in described
    assert not (tmp_path / "no-home").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        ["hidden", "vendors", results.name, f"{results.name}.tar.gz"]
    )
    with tarfile.open(f"{results}.tar.gz") as packed:
        assert f"{results.name}/devices.log" in packed.getnames()


def test_a_step_that_fails_does_not_stop_the_others(kit, tmp_path):
    code, printed, results = tried(kit, tmp_path, "check-tiny devices run-quick", "no such device")
    assert code == 8
    assert re.search("^passed   devices", printed, re.M)
    for step in ("check-tiny", "run-quick"):
        assert re.search(f"^FAILED   {step}: exit code 2; its log: {step}.log: ", printed, re.M)
        assert "no such device" in (results / f"{step}.log").read_text()
    assert printed.splitlines()[-1].startswith("results: ")


def test_no_python(kit, tmp_path):
    code, printed, _ = tried(kit, tmp_path, "devices", FREEPATH_PYTHON="python-of-nobody")
    assert code == 8
    assert "FAILED   python: none of version 3.10 or later; FREEPATH_PYTHON names one" in printed


def test_what_takes_too_long_is_stopped(kit, tmp_path):
    code, printed, _ = tried(kit, tmp_path, "devices check-tiny", FREEPATH_KIT_SECONDS="4")
    assert code == 8
    assert re.search("^(TIMEOUT  set-up: stopped after|not run  (devices|set-up))", printed, re.M)
