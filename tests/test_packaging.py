"""Wheel and sdist hold what freepath needs to run, and it is found from any folder."""

import json
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from freepath.compose import catalog
from freepath.config.schema import json_schema

ROOT = Path(__file__).parents[1]
FOLDERS = {
    "harness/freepath": "freepath",
    "kernels": "freepath/kernels",
    "configs": "freepath/configs",
}
"""Folders of the checkout, and where they are in the wheel."""
SUFFIXES = {
    "harness/freepath": {".py", ".html", ".css", ".js", ".yaml"},
    "kernels": {".cl"},
    "configs": {".yaml"},
}
MADE = {"freepath/configs/schema.json"}


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    """A copy of the checkout in a folder named freepath, as git would clone it."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=False,
        capture_output=True,
        text=True,
    )
    if listed.returncode:
        pytest.skip("no git checkout")
    folder = tmp_path_factory.mktemp("src") / "freepath"
    for name in filter(None, listed.stdout.split("\0")):
        source, target = ROOT / name, folder / name
        if source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(source.read_bytes())
    return folder


@pytest.fixture(scope="module")
def built(clone, tmp_path_factory):
    """A folder with the sdist of the clone, and the wheel that is built from that."""
    pytest.importorskip("setuptools", minversion="77", reason="what pyproject.toml builds with")
    folder = tmp_path_factory.mktemp("built")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(clone)]
    made = subprocess.run(command, check=False, capture_output=True, text=True)
    assert made.returncode == 0, made.stdout + made.stderr
    return folder


@pytest.fixture(scope="module")
def wheel(built):
    (path,) = built.glob("*.whl")
    return zipfile.ZipFile(path)


def beside(folders):
    """What a checkout has in these folders that freepath needs."""
    return {
        path.relative_to(ROOT).as_posix()
        for name in folders
        for path in (ROOT / name).rglob("*")
        if path.suffix in SUFFIXES[name]
    }


def expected():
    """What must be in the wheel, by the checkout."""
    return MADE | {
        f"{FOLDERS[name]}/{path.removeprefix(f'{name}/')}"
        for name in FOLDERS
        for path in beside([name])
    }


def test_everything_that_is_needed_is_in_the_wheel(wheel):
    assert not expected() - set(wheel.namelist())


def test_nothing_else_is_in_the_wheel(wheel):
    further = {name for name in set(wheel.namelist()) - expected() if ".dist-info/" not in name}
    assert further <= {"freepath/kernels/README.md"}


def test_something_of_each_kind_is_expected():
    for name in (
        "freepath/cli.py",
        "freepath/show/report/page.js",
        "freepath/scene/media/grid.py",
        "freepath/kernels/main.cl",
        "freepath/kernels/trackers/delta.cl",
        "freepath/configs/quick.yaml",
    ):
        assert name in expected()


def test_everything_that_is_needed_is_in_the_sdist(built):
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert not beside(FOLDERS) - names
    assert {"setup.py", "setup.cfg", "pyproject.toml", "README.md", "LICENSE"} <= names


def test_the_schema_in_the_wheel_is_current(wheel):
    (name,) = MADE
    assert json.loads(wheel.read(name)) == json_schema(catalog.load().parameter_models())


def test_the_command_is_in_the_wheel(wheel):
    assert any(name.endswith("dist-info/entry_points.txt") for name in wheel.namelist())


def test_the_wheel_needs_nothing_beside_it(wheel, tmp_path):
    """Unpacked and alone it composes a kernel of a config that ships."""
    site, empty = tmp_path / "site", tmp_path / "empty"
    wheel.extractall(site)
    empty.mkdir()
    code = (
        f"import sys; sys.path.insert(0, {str(site)!r})\n"
        "from freepath import config, paths\n"
        "from freepath.compose import catalog, kernel_files\n"
        "print(paths.HOME, len(config.shipped()), len(catalog.load().trackers))\n"
        "print(len(kernel_files.read('main').code))\n"
    )
    ended = python(code, empty)
    main = (ROOT / "kernels" / "main.cl").read_text("utf-8")
    counts = len(list((ROOT / "configs").rglob("*.yaml"))), len(catalog.load().trackers)
    assert ended == f"{site / 'freepath'} {counts[0]} {counts[1]}\n{len(main)}\n"


def python(code, folder):
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, check=False, capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.mark.parametrize("where", ["", "kernels", "harness", "tests", "..", "../.."])
def test_freepath_is_imported_in_any_folder(clone, where):
    """In the folder of a clone too, whose name Python could take for that of a package."""
    assert clone.name == "freepath"
    code = "import freepath; print(freepath.load.__name__, len(freepath.__version__) > 0)"
    assert python(code, clone / where) == "load True\n"
