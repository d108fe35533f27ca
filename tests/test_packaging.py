"""The wheel holds what freepath needs to run, and nothing else: package data is easily lost."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = {"harness": "freepath", "kernels": "freepath/kernels", "configs": "freepath/configs"}
"""Folders of the checkout, and where they are in the wheel."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The names in a wheel that is built from a copy, so that the checkout is left as it is."""
    pytest.importorskip("setuptools", minversion="77", reason="what pyproject.toml builds with")
    folder = tmp_path_factory.mktemp("wheel")
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=False,
        capture_output=True,
        text=True,
    )
    if listed.returncode:
        pytest.skip("no git checkout")
    for name in filter(None, listed.stdout.split("\0")):
        source, target = ROOT / name, folder / "copy" / name
        if source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(source.read_bytes())
    options = ["--wheel", "--no-isolation", "--outdir", str(folder)]
    built = subprocess.run(
        [sys.executable, "-m", "build", *options, str(folder / "copy")],
        check=False,
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    (path,) = folder.glob("*.whl")
    return zipfile.ZipFile(path).namelist()


def expected():
    """What must be in it, by the checkout."""
    suffixes = {
        "harness": {".py", ".html", ".css", ".js"},
        "kernels": {".cl", ".py"},
        "configs": {".yaml", ".json", ".py"},
    }
    return {
        f"{FOLDERS[name]}/{path.relative_to(ROOT / name).as_posix()}"
        for name in FOLDERS
        for path in (ROOT / name).rglob("*")
        if path.suffix in suffixes[name]
    }


def test_everything_that_is_needed_is_in_the_wheel(wheel):
    assert not expected() - set(wheel)


def test_nothing_else_is_in_the_wheel(wheel):
    further = {name for name in set(wheel) - expected() if ".dist-info/" not in name}
    assert further <= {"freepath/kernels/README.md"}


def test_something_of_each_kind_is_expected():
    for name in (
        "freepath/cli.py",
        "freepath/report/page.js",
        "freepath/scene/grid.py",
        "freepath/kernels/main.cl",
        "freepath/kernels/trackers/delta.cl",
        "freepath/configs/quick.yaml",
        "freepath/configs/schema.json",
    ):
        assert name in expected()


def test_the_command_is_in_the_wheel(wheel):
    assert any(name.endswith("dist-info/entry_points.txt") for name in wheel)
