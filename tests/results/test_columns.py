"""The list of columns, and that an axis or a column is added in few files."""

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import freepath
from freepath import config
from freepath.cases import plan
from freepath.compose import catalog
from freepath.config import AXES
from freepath.results import columns

PACKAGE = Path(freepath.__file__).parent
ROOT = PACKAGE.parents[1]
NOTATION = ROOT / "docs" / "notation.md"


def test_the_documented_columns_are_those_of_the_list():
    text = NOTATION.read_text("utf-8")
    assert columns.documented(text) == text, "run: make schema"
    wrong = text.replace("| `rmse` | number |", "| `rmse` | text |")
    assert columns.documented(wrong) == text != wrong
    with pytest.raises(ValueError, match=r"one table of samples.csv"):
        columns.documented(text.replace("columns of samples.csv", ""))


def test_every_axis_has_a_column():
    assert {axis.column or name for name, axis in AXES.items()} <= set(columns.COLUMNS)


def test_every_column_of_a_kind_has_one_type():
    for table in (columns.SAMPLES_TABLE, columns.CONFIRM_TABLE):
        for column in table:
            assert (column.name in columns.TEXTS) == (column.type == "str")


AXIS = """
    Axis(
        "mood",
        Choice(("calm", "wild")),
        ("calm",),
        "A made-up axis.",
        usual="calm",
        later=True,
    ),
)
AXES = """
COLUMN = """
mood str - made up
params str"""
CONFIG = """\
name: x
rays: {chords: {count: 16}}
matrix: {medium: {homogeneous: {sigma_t: 1}}, tracker: [delta, regular]}
include: {tracker: ratio, mood: [calm, wild]}
exclude: {tracker: regular, mood: wild}
stop: {samples: 8}
"""


@pytest.fixture
def with_another_axis(tmp_path):
    """A copy of the package in which two files are edited."""
    package = tmp_path / "copy" / "freepath"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("kernels", "configs"):
        shutil.copytree(ROOT / name, package / name)
    edits = (
        ("config/axes.py", "\n)\nAXES = ", AXIS),
        ("results/columns.py", "\nparams str", COLUMN),
    )
    for name, old, new in edits:
        text = (package / name).read_text("utf-8")
        assert text.count(old) == 1
        (package / name).write_text(text.replace(old, new), encoding="utf-8")
    (tmp_path / "x.yaml").write_text(CONFIG)

    def freepath(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "freepath", *arguments],
            check=False,
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(package.parent)},
            capture_output=True,
            text=True,
        )

    return freepath


def test_a_new_axis_is_an_edit_in_two_files(with_another_axis, tmp_path, selector):
    """It is parsed, overridden, included, excluded, named, identified, run and written."""
    told = with_another_axis("run", "x.yaml", "-N", "-a", "mood=wild,clam")
    assert told.returncode == 2
    assert "mood[1]: expected calm or wild, got 'clam'; did you mean 'calm'?" in told.stderr
    ran = with_another_axis("run", "x.yaml", "-a", "mood=calm,wild", "-o", "out", "-d", selector)
    assert ran.returncode == 0, ran.stderr
    with (tmp_path / "out" / "summary.csv").open() as file:
        found = {(row["tracker"], row["mood"]): row for row in csv.DictReader(file)}
    wanted = {(t, m) for t in ("delta", "ratio") for m in ("calm", "wild")} | {("regular", "calm")}
    assert set(found) == wanted
    for column in columns.SUMMARY_TABLE:
        for row in found.values():
            # a cell that is not of its column's type is a ValueError
            {"str": str, "int": int, "float": float}[column.type](row[column.name] or 0)
    calm, wild = found["delta", "calm"], found["delta", "wild"]
    assert calm["case"] == "transmittance/homogeneous-1/global/t1/delta/auto/strict"
    assert wild["case"] == "transmittance/homogeneous-1/global/t1/mood=wild/delta/auto/strict"
    assert calm["case_id"] != wild["case_id"]
    # what was there before has the identity that it had
    (tmp_path / "y.yaml").write_text(CONFIG.replace("include", "#").replace("exclude", "#"))
    known = catalog.load()
    cases = plan.expand(config.load(tmp_path / "y.yaml", known.parameter_models()), known)
    assert [case.case_id for case in cases] == [
        found[tracker, "calm"]["case_id"] for tracker in ("delta", "regular")
    ]
    assert "mood" not in AXES
