"""Comparisons: verdicts, false alarms among real reruns and modelled ones, planted changes."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from freepath import compare
from freepath.cli import main
from freepath.compare import trials
from freepath.compare.pairing import Run, Side
from freepath.results import COLUMNS, SAMPLE_COLUMNS
from scipy import stats

RERUNS = Path(__file__).parent / "data" / "reruns.npz"
"""Seconds a sample of every round of 54 reruns of 16 cases, on two cores with a load of 1 to 14."""
ROUNDS = 100
SETTINGS = compare.Settings()


def row_of(name, **changes):
    row = dict.fromkeys(COLUMNS, "") | {
        "schema_version": "4",
        "run_id": "r",
        "case_id": name,
        "case": f"transmittance/m/{name}/auto/strict",
        "status": "ok",
        "device": "d",
        "platform": "p",
        "driver_version": "1",
        "medium": "m",
        "rays": "64",
        "seed": "1",
        "lanes": "16",
        "arithmetic": "strict",
        "samples_per_ray": "100",
        "counted_samples": "6400",
        "lookups_per_sample": "3.5",
        "timing_source": "device",
        "estimate": "0.5",
        "reference": "0.5",
        "bias_stderr": "0.0005",
        "variance": "0.25",
        "time_per_sample_s": "1e-06",
        "lane_occupancy": "0.9",
        "majorant": "none",
    }
    return row | changes


def modelled(random, cases=8, rounds=ROUNDS, noise=0.01):
    """A run: a level of its own, a drift that lasts, and noise with rare high values."""
    drift = 0.1 * random.normal() + np.cumsum(0.02 * random.normal(size=rounds))
    run = Run({}, {}, {}, {})
    for i in range(cases):
        key = (f"c{i}", "d", "p")
        run.rows[key] = row_of(f"c{i}")
        rare = 0.2 * random.exponential(size=rounds) * (random.random(rounds) < 0.05)
        times = 1e-6 * (1 + i) * np.exp(drift + noise * random.normal(size=rounds) + rare)
        run.times[key] = dict(enumerate(times.tolist()))
        run.variances[key] = (0.25 + 0.01 * random.normal(size=rounds)).tolist()
    return run


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
    judged, _ = compare.compare(reference, contender, SETTINGS)
    assert {one.key: one.verdict for one in judged} == {
        one.key: verdict if one.key == key else "SAME" for one in judged
    }


@pytest.mark.parametrize(("estimate", "verdict"), [("0.5001", "SAME"), ("0.51", "DIFFERENT")])
def test_cases_without_an_exact_value_are_compared(estimate, verdict):
    random = np.random.default_rng(1)
    reference, key = side(random)
    contender, _ = side(random, estimate=estimate, seed="2")
    for run in (*reference.runs, *contender.runs):
        run.rows = {name: row | {"reference": ""} for name, row in run.rows.items()}
    judged, _ = compare.compare(reference, contender, SETTINGS)
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
    for k, expected in ((1, {"SAME"}), (6, {"SLOWER"})):
        reference, contender = trials.copied("a", runs[:k]), trials.copied("b", runs[10 : 10 + k])
        for key in runs[0].rows:
            trials.slowed(contender, key, 2.0)
        judged, _ = compare.compare(reference, contender, SETTINGS)
        assert {one.verdict for one in judged} == expected


def write(folder, run, *, names=None, processor="x"):
    folder.mkdir(parents=True)
    names = names or list(run.rows)
    with (folder / "summary.csv").open("w") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(run.rows[name] for name in names)
    with (folder / "samples.csv").open("w") as file:
        writer = csv.DictWriter(file, SAMPLE_COLUMNS)
        writer.writeheader()
        for key in names:
            for number, seconds in run.times[key].items():
                values = {"case_id": key[0], "device": "d", "platform": "p", "round": number}
                values |= {"samples": 1000, "time_device_s": 1000 * seconds, "variance": 0.25}
                values["time_wall_s"] = values["time_device_s"]
                writer.writerow(dict.fromkeys(SAMPLE_COLUMNS, "") | values)
    host = {"processor": processor, "cores": 2, "system": "s"}
    (folder / "run.json").write_text(json.dumps({"sessions": [{"host": host}]}))
    return folder


def test_the_command(tmp_path, runs, capsys):
    keys = list(runs[0].rows)
    a = write(tmp_path / "a", runs[0], names=keys[:-1])
    b = write(tmp_path / "b<i>", runs[1], names=keys[1:])
    assert main(["compare", str(a), str(a)]) == 0
    assert "7 SAME" in capsys.readouterr().out
    assert main(["compare", str(a), str(b)]) == 1
    printed = capsys.readouterr().out
    assert "6 SAME, 1 MISSING, 1 NEW" in printed
    assert "contender/reference" in printed
    assert main(["compare", str(a), str(a), str(b), "-o", str(tmp_path / "m.html")]) == 1
    page = (tmp_path / "m.html").read_text()
    assert "b&lt;i&gt;" in page
    assert "<i>" not in page
    assert main(["compare", str(a), str(b), "-o", str(tmp_path / "m.csv")]) == 1
    with (tmp_path / "m.csv").open() as file:
        verdicts = [row["verdict"] for row in csv.DictReader(file)]
    assert sorted(verdicts) == ["MISSING", "NEW", *["SAME"] * 6]


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
    assert "schema version 4" in capsys.readouterr().err
    assert main(["compare", str(a), str(a), "-o", "x.pdf"]) == 2


def test_a_folder_of_runs_is_a_side(tmp_path, runs):
    for i in range(4):
        write(tmp_path / "before" / str(i), runs[i])
    assert len(compare.load(tmp_path / "before").runs) == 4
    assert main(["compare", str(tmp_path / "before"), str(tmp_path / "before")]) == 0
