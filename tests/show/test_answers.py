"""The sentence that says who is the fastest, by how much, and how biased."""

import csv
import re
from pathlib import Path

import pytest

from freepath.cli import main
from freepath.show.answers import Case, baseline_of, ratio, sentence

SWEEP = """\
name: x
rays: {orthographic: {resolution: [8, 8]}}
matrix: {medium: {homogeneous: {sigma_t: 1}}, tightness: [1, 4], tracker: [delta, ratio]}
stop: {samples: 4000}
"""


def case(tracker, time, *, majorant="global", tightness=1.0, noise=0.05, bias=0.0):
    name = f"transmittance/m/{majorant}/t{tightness}/{tracker}/auto/strict"
    return Case(name, tracker, tracker, majorant, tightness, time, noise, bias)


DELTA = case("delta", 91e-6)
RATIO = case("ratio", 18.2e-6, majorant="grid-16x11x20", tightness=4.0)
REGULAR = case("regular", 437e-9, majorant="none", tightness=None, noise=0.02)
MARCH = case(
    "march-step=3.3333332538604736", 194e-9, majorant="none", tightness=None, noise=0.02, bias=3e-5
)


def test_the_sentence():
    assert sentence([DELTA, RATIO]) == (
        "At 1 %: ratio, grid 16x11x20, tightness 4 is 5.0 (4.7 to 5.4) times as fast as "
        "delta, global, tightness 1."
    )
    assert sentence([RATIO, MARCH, REGULAR, DELTA], 0.001) == (
        "At 0.1 %: march-step=3.333 is 469 (444 to 495) times as fast as delta, global, "
        "tightness 1, biased by 0.003 %; fastest without measurable bias: regular, "
        "208 (197 to 220) times as fast."
    )
    assert "; biased by 1 %: x, none" in sentence(
        [DELTA, RATIO, case("x", 20e-6, majorant="none-x", bias=0.01)]
    )


def test_what_is_not_known_never_leads():
    """Sixteen thousand times as fast, of an interval that holds 0."""
    lucky = case("equiangular", 1e-9, noise=1.43)
    told = sentence([DELTA, RATIO, lucky])
    assert told.startswith("At 1 %: ratio, grid 16x11x20")
    assert told.endswith("; not ranked, as their variance is not settled: 1.")
    assert baseline_of([lucky, DELTA]) is DELTA
    told = sentence([lucky], failed=2)
    assert told == (
        "At 1 %: the variance of no case is settled; measure longer; not ranked, as their variance "
        "is not settled: 1; not ranked, as they failed: 2."
    )
    assert sentence([]) == "At 1 %: no case reaches it."


def test_what_is_as_fast_is_named():
    near = case("split", 18.4e-6)
    assert "not significantly slower: split, global, tightness 1)" in sentence([DELTA, RATIO, near])
    assert sentence([DELTA]) == "At 1 %: delta, global, tightness 1 is the fastest."


def test_the_baseline():
    assert baseline_of([RATIO, DELTA, REGULAR]) is DELTA
    assert baseline_of([RATIO, REGULAR]) is RATIO  # the slowest
    assert baseline_of([RATIO, DELTA, REGULAR], "regular") is REGULAR
    assert baseline_of([RATIO, DELTA], "none such") is DELTA
    middle, low, high = ratio(DELTA, RATIO)
    assert middle == pytest.approx(5.0)
    assert low * high == pytest.approx(25.0)


def test_a_run_ends_with_the_sentence_that_its_table_has(work, selector, capsys):
    """To the last digit of the column, in 80 columns; the baseline is slow on any busy machine."""
    (work / "x.yaml").write_text(SWEEP)
    assert main(["run", "x.yaml", "-o", "out", "-d", selector, "--baseline", "t4/delta"]) == 0
    printed = capsys.readouterr().out.splitlines()
    (told,) = [line for line in printed if line.startswith("At 1 %: ")]
    found = re.match(r"At 1 %: (\w+), global, tightness (\d) is ([\d.]+) \(", told)
    assert found, told
    best = next(line for line in printed if " *" in line and " x" in line)
    assert best.split()[0] == found[1]
    assert best.split()[-1] == found[3]
    start = next(i for i, line in enumerate(printed) if line.startswith("transmittance of"))
    assert all(len(line) <= 80 for line in printed[start : start + 6])
    with Path("out/summary.csv").open() as file:
        times = {row["case"]: float(row["time_to_1pct_s"]) for row in csv.DictReader(file)}
    delta = next(time for name, time in times.items() if "/t4/delta" in name)
    assert float(found[3]) == pytest.approx(delta / min(times.values()), rel=0.1)
    for words in (["--baseline", "none such"], ["--baseline", "t4/delta"]):
        code = main(["run", "x.yaml", "-o", "out", "--resume", "-d", selector, *words])
        assert code == (2 if "none such" in words else 0)
    captured = capsys.readouterr()
    assert "--baseline none such: no case has a name that matches" in captured.err
    assert "times as fast as delta, global, tightness 4" in " ".join(captured.out.split())
