"""Comparisons: verdicts, false alarms among real reruns and modelled ones, planted changes."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from junitparser import JUnitXml
from scipy import stats

from freepath.cli import main
from freepath.show import compare
from freepath.show.compare.pairing import Run, Side
from support import trials
from support.runs import ROUNDS, modelled, row_of, write

RERUNS = Path(__file__).parents[1] / "data" / "reruns.npz"
"""Seconds a sample of every round of 54 reruns of 16 cases, on two cores with a load of 1 to 14."""
SETTINGS = compare.Settings()
TELLING = compare.Settings(factor=1.05, drift=2.0)
"""With these a run of 100 rounds of the model can show that nothing changed."""


def real():
    """The real reruns as runs."""
    runs = []
    with np.load(RERUNS) as data:
        for times in data["times"]:
            run = Run({}, {}, {}, {})
            for i, one in enumerate(times):
                key = (f"c{i}", "d", "p")
                run.rows[key] = row_of(f"c{i}", medium="ab"[i % 2])
                run.times[key] = {n: float(t) for n, t in enumerate(one) if np.isfinite(t)}
            runs.append(run)
    return runs


@pytest.fixture(scope="module")
def runs():
    random = np.random.default_rng(3)
    return [modelled(random) for _ in range(60)]


def at_most(found, tries, alpha=0.05):
    """Whether so many false alarms are no evidence of a rate above alpha (at 0.1 %)."""
    return stats.binomtest(found, tries, alpha, alternative="greater").pvalue > 1e-3


@pytest.mark.parametrize("k", [1, 3])
def test_reruns_raise_no_more_false_alarms_than_alpha(runs, k):
    found, _, _ = trials.rate(runs, k, 300, SETTINGS)
    assert at_most(found, 300)


@pytest.mark.parametrize("k", [1, 3])
def test_real_reruns_raise_no_more_false_alarms_than_alpha(k):
    found, _, _ = trials.rate(real(), k, 150, SETTINGS)
    assert at_most(found, 150)


PLANTED = [(1, trials.slowed), (4, trials.slowed), (1, trials.biased)]


@pytest.mark.parametrize(("k", "plant"), PLANTED)
def test_planted_changes_are_found(runs, k, plant):
    found, _, _ = trials.rate(runs, k, 200, SETTINGS, plant)
    assert found >= 190


def side(random, rounds=ROUNDS, **changes):
    found = Side("side", [modelled(random, rounds=rounds)])
    key = ("c0", "d", "p")
    found.runs[0].rows[key] = found.runs[0].rows[key] | changes
    return found, key


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, "SAME"),
        ({"lookups_per_sample": "3.6"}, "DIFFERENT"),
        ({"estimate": "0.5001"}, "DIFFERENT"),  # the same samples must agree
        ({"estimate": "0.5001", "seed": "2"}, "SAME"),
        ({"estimate": "0.51", "seed": "2"}, "DIFFERENT"),
        ({"lookups_per_sample": "3.6", "seed": "2"}, "SAME"),
        ({"status": "mismatch", "reason": "why"}, "DIFFERENT"),
    ],
)
def test_verdicts(changes, verdict):
    random = np.random.default_rng(1)
    reference, key = side(random)
    contender, _ = side(random, **changes)
    judged, _ = compare.compare(reference, contender, TELLING)
    assert {one.key: one.verdict for one in judged} == {
        one.key: verdict if one.key == key else "SAME" for one in judged
    }


def test_code_that_draws_other_numbers_is_compared_by_z():
    """0.0001 is 0.14 standard errors: another estimate of the same samples, or chance."""
    for same, estimate, verdict in (
        (True, "0.5001", "DIFFERENT"),
        (False, "0.5001", "SAME"),
        (False, "0.51", "DIFFERENT"),
    ):
        random = np.random.default_rng(1)
        (before, key), (after, _) = side(random), side(random, estimate=estimate)
        settings = compare.Settings(factor=1.05, drift=2.0, same_samples=same)
        judged, _ = compare.compare(before, after, settings)
        assert {one.key: one.verdict for one in judged}[key] == verdict


@pytest.mark.parametrize(("estimate", "verdict"), [("0.5001", "SAME"), ("0.51", "DIFFERENT")])
def test_cases_without_an_exact_value_are_compared(estimate, verdict):
    random = np.random.default_rng(1)
    reference, key = side(random)
    contender, _ = side(random, estimate=estimate, seed="2")
    for run in (*reference.runs, *contender.runs):
        run.rows = {name: row | {"reference": ""} for name, row in run.rows.items()}
    judged, _ = compare.compare(reference, contender, TELLING)
    (one,) = [one for one in judged if one.key == key]
    assert one.verdict == verdict
    assert one.difference == pytest.approx((float(estimate) - 0.5) / 0.5)


@pytest.mark.parametrize(("factor", "verdict"), [(1.2, "SLOWER"), (0.8, "FASTER")])
def test_times(factor, verdict):
    random = np.random.default_rng(1)
    reference, key = side(random)
    contender, _ = side(random)
    trials.slowed(contender, key, factor)
    judged, _ = compare.compare(reference, contender, SETTINGS)
    (one,) = [one for one in judged if one.key == key]
    assert one.verdict == verdict
    assert one.time_low < factor < one.time_high
    assert one.regressed == (factor > 1)


@pytest.mark.parametrize(("factor", "verdict"), [(1.5, "MORE_NOISE"), (0.5, "LESS_NOISE")])
def test_noise(factor, verdict):
    random = np.random.default_rng(1)
    reference, key = side(random)
    contender, _ = side(random)
    contender.runs[0].variances[key] = [factor * v for v in contender.runs[0].variances[key]]
    judged, _ = compare.compare(reference, contender, SETTINGS)
    assert [one.verdict for one in judged if one.key == key] == [verdict]


def test_a_slowdown_of_all_cases_takes_several_runs(runs):
    for k, expected in ((1, {"UNDECIDED"}), (6, {"SLOWER"})):
        reference, contender = trials.copied("a", runs[:k]), trials.copied("b", runs[10 : 10 + k])
        for key in runs[0].rows:
            trials.slowed(contender, key, 2.0)
        judged, _ = compare.compare(reference, contender, SETTINGS)
        assert {one.verdict for one in judged} == expected


def test_the_command(tmp_path, runs, capsys):
    keys = list(runs[0].rows)
    a = write(tmp_path / "a", runs[0], names=keys[:-1])
    b = write(tmp_path / "b<i>", runs[1], names=keys[1:])
    telling = ["--factor", "5%", "--drift", "2"]
    assert main(["compare", str(a), str(a), *telling]) == 0
    assert "7 SAME" in capsys.readouterr().out
    assert main(["compare", str(a), str(b), *telling]) == 1
    printed = capsys.readouterr().out
    assert "6 SAME, 1 MISSING, 1 NEW" in printed
    assert "MISSING    transmittance/m/c0/auto/strict\n    the contender has no such" in printed
    assert main(["compare", str(a), str(a), str(b), "-o", str(tmp_path / "m.html")]) == 1
    page = (tmp_path / "m.html").read_text()
    assert "b&lt;i&gt;" in page
    assert "<i>" not in page
    assert main(["compare", str(a), str(b), *telling, "-o", str(tmp_path / "m.csv")]) == 1
    with (tmp_path / "m.csv").open() as file:
        verdicts = [row["verdict"] for row in csv.DictReader(file)]
    assert sorted(verdicts) == ["MISSING", "NEW", *["SAME"] * 6]


def test_for_machines(tmp_path, runs, capsys):
    keys = list(runs[0].rows)
    a = write(tmp_path / "a", runs[0], names=keys[:-1])
    b = write(tmp_path / "b", runs[1], names=keys[1:])
    xml = tmp_path / "out.xml"
    assert main(["compare", str(a), str(b), "--json", "--output-junit", str(xml)]) == 1
    found = json.loads(capsys.readouterr().out)
    assert len(found) == 8
    assert {one["verdict"] for one in found} == {"UNDECIDED", "MISSING", "NEW"}
    assert all(one["seen_from"] > 1 for one in found if one["verdict"] == "UNDECIDED")
    suite = JUnitXml.fromfile(str(xml))
    assert (suite.tests, suite.failures, suite.skipped) == (8, 1, 6)
    assert main(["compare", str(a), str(b), "--md"]) == 1
    text = capsys.readouterr().out
    assert "6 UNDECIDED, 1 MISSING, 1 NEW**" in text
    assert "| MISSING | transmittance/m/c0/auto/strict |" in text
    assert main(["compare", str(a), str(b), "-o", str(tmp_path / "m.json")]) == 1
    assert json.loads((tmp_path / "m.json").read_text()) == found


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("none", 0),
        ("slower, more_noise", 0),
        ("NEW", 1),
        ("UNDECIDED", 1),
        ("MISSING", 1),
        ("SAME", 0),
    ],
)
def test_the_words_that_fail(tmp_path, runs, words, code):
    keys = list(runs[0].rows)
    a = write(tmp_path / "a", runs[0], names=keys[:-1])
    b = write(tmp_path / "b", runs[1], names=keys[1:])
    assert main(["compare", str(a), str(b), "--fail-on", words]) == code


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--alpha", "110%"], "expected a share between 0 and 1, as 0.05 or 5%, got '110%'"),
        (["--alpha", "x"], "expected a share between 0 and 1"),
        (["--factor", "0.9"], "expected a ratio of 1 or more, as 1.05, or what it is above 1"),
        (["--fail-on", "WORSE"], "expected words of SAME, UNDECIDED, "),
    ],
)
def test_what_cannot_be_asked(tmp_path, capsys, words, told):
    with pytest.raises(SystemExit) as ended:
        main(["compare", "a", "b", *words])
    assert ended.value.code == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["real", "quiet", "loud"])
def test_no_single_runs_are_same_that_are_not(kind):
    """Of 200 pairs in which a case takes 1.3 times as long. What is told of it holds in 95 %."""
    random = np.random.default_rng(4)
    noise = {"quiet": 0.01, "loud": 0.3}.get(kind)
    runs = [modelled(random, 5, 20, noise) for _ in range(40)] if noise else real()
    settings, found, wrong = compare.Settings(factor=1.1, drift=20.0), [], 0
    for _ in range(200):
        first, second = random.choice(len(runs), 2, replace=False)
        reference = trials.copied("a", [runs[first]])
        contender = trials.copied("b", [runs[second]])
        key = sorted(reference.rows)[random.integers(len(reference.rows))]
        trials.slowed(contender, key, 1.3)
        judged, _ = compare.compare(reference, contender, settings)
        (one,) = [one for one in judged if one.key == key]
        found.append(one.verdict)
        wrong += one.verdict == "UNDECIDED" and one.seen_from < 1.3
    assert "SAME" not in found
    assert at_most(wrong, max(1, found.count("UNDECIDED")))
    # a quiet machine shows it, and a loud one says that it cannot
    assert found.count("SLOWER") >= 190 if kind == "quiet" else found.count("UNDECIDED") >= 100


def test_what_did_not_change_is_shown_to_be_the_same(runs):
    """Single runs of a quiet machine show it only where its drift is no reason to doubt."""
    reference, contender = trials.copied("a", runs[:1]), trials.copied("b", runs[1:2])
    for drift, expected in ((2.0, {"SAME"}), (None, {"UNDECIDED"})):
        judged, _ = compare.compare(
            reference, contender, compare.Settings(factor=1.05, drift=drift)
        )
        assert {one.verdict for one in judged} == expected


def test_so_many_runs_as_are_said_show_five_percent():
    """Runs whose cases differ by 2 % each: three a side say how many more it takes."""
    random = np.random.default_rng(8)

    def several(count):
        runs = [modelled(random, rounds=12) for _ in range(count)]
        for run in runs:
            for key in run.times:
                trials.slowed(Side("", [run]), key, math.exp(0.02 * random.normal()))
        return runs

    said = []
    for _ in range(6):
        a, b = Side("a", several(3)), Side("b", several(3))
        judged, _ = compare.compare(a, b, SETTINGS)
        said += [one.runs for one in judged if one.verdict == "UNDECIDED" and one.runs]
    needed, found = int(np.median(said)), []
    for _ in range(16):
        a, b = Side("a", several(needed)), Side("b", several(needed))
        trials.slowed(b, ("c0", "d", "p"))
        judged, _ = compare.compare(a, b, SETTINGS)
        found.append(judged[0].verdict == "SLOWER")
    assert 5 <= needed <= 60
    assert stats.binomtest(sum(found), len(found), 0.95, alternative="less").pvalue > 1e-3


def test_what_failed_on_both_sides_is_not_the_same(runs):
    sides = [trials.copied(name, [run]) for name, run in zip("ab", runs, strict=False)]
    key = next(iter(runs[0].rows))
    for one in sides:
        one.runs[0].rows[key] = one.runs[0].rows[key] | {"status": "build_failed"}
        del one.runs[0].times[key]
    judged, _ = compare.compare(*sides, TELLING)
    (one,) = [one for one in judged if one.key == key]
    assert (one.verdict, one.why) == ("UNDECIDED", "build_failed in both")


def test_without_rounds_nothing_is_the_same(runs):
    reference, contender = trials.copied("a", runs[:1]), trials.copied("b", runs[1:2])
    contender.runs[0].times = {}
    contender.runs[0].effects = None
    judged, _ = compare.compare(reference, contender, TELLING)
    assert {(one.verdict, one.why) for one in judged} == {
        ("UNDECIDED", "no rounds to compare times by")
    }


def test_a_result_whose_rounds_were_cut_is_refused(tmp_path, capsys):
    """84 rounds as the summary has it, of which 2 are left."""
    run = modelled(np.random.default_rng(1), rounds=84)
    for row in run.rows.values():
        row |= {"rounds": "84", "samples_per_ray": "1000", "rays": "84", "run_id": ""}
    folder = write(tmp_path / "a", run)
    assert main(["compare", str(folder), str(folder), "--drift", "2"]) == 0
    lines = (folder / "samples.csv").read_text().splitlines(keepends=True)
    kept = [line for line in lines[1:] if int(line.split(",")[5]) < 2]
    (folder / "samples.csv").write_text("".join([lines[0], *kept]))
    assert main(["compare", str(folder), str(folder)]) == 2
    told = capsys.readouterr().err
    assert "a/summary.csv:2: transmittance/m/c0/auto/strict: expected 84 rounds of 84000" in told
    assert "found 2 of 2000: a file was cut or changed" in told


def test_percent_signs_are_taken(tmp_path, runs, capsys):
    a, b = write(tmp_path / "a", runs[0]), write(tmp_path / "b", runs[1])
    printed = []
    for alpha, factor in (("0.05", "1.05"), ("5%", "5%"), ("5 %", "5 %")):
        words = ["--alpha", alpha, "--factor", factor, "--drift", "100%", "--json"]
        assert main(["compare", str(a), str(b), *words]) == 0
        printed.append(capsys.readouterr().out)
    assert len(set(printed)) == 1


def test_results_that_pair_with_nothing_say_why(tmp_path, runs, capsys):
    a = write(tmp_path / "a", runs[0])
    for name, changes, told in (
        ("b", {"device": "e"}, "device is 'd' and 'e'"),
        ("c", {"case_id": "x", "medium": "n"}, "medium is 'm' and 'n'"),
        ("d", {"case_id": "x"}, "their case_ids differ"),
    ):
        other = Run({}, {}, {}, {})
        row = next(iter(runs[1].rows.values())) | changes
        key = (row["case_id"], row["device"], row["platform"])
        other.rows[key], other.times[key] = row, {}
        assert main(["compare", str(a), str(write(tmp_path / name, other))]) == 2
        assert f"no case of one pairs with a case of the other: {told}\n" in capsys.readouterr().err


def test_what_should_not_be_compared_is_refused(tmp_path, runs, capsys):
    a = write(tmp_path / "a", runs[0])
    b = write(tmp_path / "b", runs[1], processor="y")
    assert main(["compare", str(a), str(b)]) == 2
    assert "different machines: processor is x and y" in capsys.readouterr().err
    assert main(["compare", str(a), str(b), "--other-machine"]) == 0
    assert main(["compare", str(a), str(tmp_path / "none")]) == 2
    assert "expected the folder of a run" in capsys.readouterr().err
    (b / "summary.csv").write_text("a,b\n")
    assert main(["compare", str(a), str(b)]) == 2
    assert "schema version 6" in capsys.readouterr().err
    assert main(["compare", str(a), str(a), "-o", "x.pdf"]) == 2


def test_a_folder_of_runs_is_a_side(tmp_path, runs):
    for i in range(4):
        write(tmp_path / "before" / str(i), runs[i])
    assert len(compare.load(tmp_path / "before").runs) == 4
    assert main(["compare", str(tmp_path / "before"), str(tmp_path / "before")]) == 0
