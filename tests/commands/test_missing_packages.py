"""Where OpenImageIO and what draws charts are not installed, all works that has no use for them."""

import os
import subprocess
import sys

import numpy as np
import pytest

pytestmark = pytest.mark.slow
BLOCKING = """\
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("OpenImageIO", "altair", "vl_convert"):
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
sys.meta_path.insert(0, Blocked())
"""
SMALL = """\
name: small
rays: {orthographic: {resolution: [4, 4]}}
matrix: {medium: {homogeneous: {sigma_t: 1}}, tracker: delta}
stop: {samples: 20}
"""
SKY = """\
name: sky
rays: {orthographic: {resolution: [4, 4]}}
matrix:
  estimand: radiance
  medium: {homogeneous: {sigma_t: 1}}
  light: {image: {file: sky.exr}}
  tracker: delta
stop: {samples: 20}
"""
VOLUME = SMALL.replace("{homogeneous: {sigma_t: 1}}", "{volume: {file: sky.exr, sigma_t: 1}}")


@pytest.fixture
def bare(work):
    """`freepath` in a Python without these packages: exit code, standard output, errors."""
    (work / "sitecustomize.py").write_text(BLOCKING)
    environment = os.environ | {"PYTHONPATH": str(work)}

    def bare(*arguments):
        command = [sys.executable, "-m", "freepath", *arguments]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False, timeout=300
        )
        return done.returncode, done.stdout, done.stderr

    return bare


def test_they_are_blocked(bare, work):
    probe = "import OpenImageIO"
    environment = os.environ | {"PYTHONPATH": str(work)}
    done = subprocess.run(
        [sys.executable, "-c", probe], env=environment, capture_output=True, text=True, check=False
    )
    assert "No module named 'OpenImageIO'" in done.stderr


@pytest.mark.parametrize("words", [["devices"], ["list"], ["list", "configs"]])
def test_what_needs_none_of_them(bare, words):
    code, _, errors = bare(*words)
    assert (code, errors) == (0, "")


def test_a_run_and_its_report_as_text(bare, selector):
    code, printed, errors = bare("run", "quick", "-d", selector, "-R", "exp.*global", "-o", "out")
    assert code == 0, printed + errors
    assert bare("report", "out", "--format", "md")[0] == 0
    code, _, errors = bare("report", "out")
    assert code == 2
    assert "a report as html: needs altair, which cannot be imported here" in errors


def test_checks_that_need_them_do_not_apply(bare, selector):
    words = "check", "-L", "tiny", "-R", "bad-input|smoke/delta", "-V", "-d", selector
    code, printed, errors = bare(*words)
    assert code == 0, printed + errors
    assert "nan-in-exr: needs OpenImageIO" in printed.replace("nan-in-exr.exr", "nan-in-exr")
    assert "100% tests passed" in printed


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("render: true\n" + SMALL, "pictures of cases: needs OpenImageIO"),
        (SKY, "sky.exr: needs OpenImageIO"),
        (VOLUME, "sky.exr: needs OpenImageIO"),
    ],
    ids=["pictures", "sky", "volume"],
)
def test_what_needs_them_says_so(bare, work, selector, text, message):
    (work / "small.yaml").write_text(text)
    np.save(work / "sky.npy", np.ones((2, 2, 2)))
    (work / "sky.npy").rename(work / "sky.exr")
    code, _, errors = bare("run", "small.yaml", "-d", selector, "-o", "out")
    assert code == 2, errors
    assert message in errors
    assert "pip install OpenImageIO" in errors
    assert "Traceback" not in errors
    assert not (work / "out").exists()
