"""Exports: each is read back by the tool that it is for, or held to the fields of its documents."""

import csv
import json

import jsonschema
import pyperf
import pytest

from freepath.cli import main
from freepath.results.folder import SAMPLE_COLUMNS
from support.rows import result_of, row_of

TIMES = {"1": (1e-6, 1.1e-6, 0.9e-6), "2": (2e-6, 2e-6, 2.2e-6), "3": (3e-6, 3e-6, 3e-6)}
RAYS, PER_RAY = 64, 300
BMF = {
    "type": "object",
    "minProperties": 1,
    "additionalProperties": {
        "type": "object",
        "additionalProperties": {
            "type": "object",
            "required": ["value"],
            "properties": dict.fromkeys(
                ("value", "lower_value", "upper_value"), {"type": "number"}
            ),
            "additionalProperties": False,
        },
    },
}
"""By bencher.dev/docs/reference/bencher-metric-format."""
NUMBER, TEXT = {"type": "number"}, {"type": "string"}
T4 = {
    "type": "object",
    "required": ["schema_version", "results"],
    "properties": {
        "schema_version": {"type": "string", "pattern": r"^\d+\.\d+\.\d+$"},
        "results": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["configuration", "times", "invalidity", "correctness"],
                "properties": {
                    "timestamp": TEXT,
                    "configuration": {"type": "object"},
                    "objectives": {"type": "array"},
                    "times": {
                        "type": "object",
                        "properties": {"compilation_time": NUMBER, "runtimes": {"type": "array"}},
                    },
                    "invalidity": {
                        "enum": [
                            "timeout",
                            "compile",
                            "runtime",
                            "correctness",
                            "constraints",
                            "correct",
                        ]
                    },
                    "correctness": NUMBER,
                    "measurements": {
                        "type": "array",
                        "items": {
                            "type": "object",
                            "properties": {"name": TEXT, "value": NUMBER, "unit": TEXT},
                        },
                    },
                },
            },
        },
    },
}
"""The results of T4 1.0.0, which Kernel Tuner has in kernel_tuner/schema."""


@pytest.fixture
def result(tmp_path):
    size = {"rounds": "3", "samples_per_ray": str(PER_RAY), "params": '{"order": 2}'}
    rows = [
        row_of(1, "delta", **size),
        row_of(2, "ratio", seconds=2e-6, variance_noise="", **size),
        row_of(3, "wrong", seconds=3e-6, status="mismatch", reason="off", **size),
        row_of(4, "slow", status="timeout", reason="hung"),
        row_of(5, "left", status="skipped"),
    ]
    rows[1]["device"] = "of two\nlines"
    folder = result_of(tmp_path / "out", rows)
    with (folder / "samples.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, SAMPLE_COLUMNS)
        writer.writeheader()
        for case, times in TIMES.items():
            for place, time in enumerate(times):
                samples = RAYS * PER_RAY // 3
                one = dict.fromkeys(SAMPLE_COLUMNS, "") | {"case_id": case, "round": str(place)}
                one |= {
                    "device": rows[int(case) - 1]["device"],
                    "platform": "p",
                    "samples": str(samples),
                }
                device = repr(time * samples)
                writer.writerow(one | {"time_device_s": device, "time_wall_s": "1"})
    return folder


@pytest.fixture
def export(result, capsys):
    def export(wanted, *options):
        code = main(["export", str(result), "--format", wanted, *options])
        captured = capsys.readouterr()
        assert code == 0
        return captured.out, captured.err

    return export


def names_of(result):
    with (result / "summary.csv").open() as file:
        return [f"{row['case']} [{row['device']}]" for row in csv.DictReader(file)][:2]


def test_bencher(result, export):
    text, told = export("bmf")
    found = json.loads(text)
    jsonschema.validate(found, BMF)
    assert list(found) == names_of(result)
    delta, ratio = found.values()
    time = {"value": 1000.0, "lower_value": 980.0, "upper_value": 1020.0}
    assert delta["time-per-sample-ns"] == pytest.approx(time)
    assert delta["time-to-1-percent-ns"]["value"] == pytest.approx(1e7)
    assert ratio.keys() == {"time-per-sample-ns", "lookups-per-sample", "variance"}
    assert "left out: transmittance/cloud-64/global/t1/wrong/auto/strict [a [b] <c>]: mism" in told
    assert "/slow/auto/strict [a [b] <c>]: timeout: hung" in told
    assert "the time to 1 % of 1 cases: it is not known" in told
    assert "/left/" not in text + told


def test_github_action_benchmark(export):
    """Fields of customSmallerIsBetter: name, unit and value; range and extra are texts."""
    found = json.loads(export("github-action-benchmark")[0])
    assert len(found) == 3
    assert len({one["name"] for one in found}) == 3
    for one in found:
        assert one.keys() == {"name", "unit", "value", "range", "extra"}
        assert isinstance(one["value"], float)
        assert one["unit"] == "ns"
    assert found[0]["range"] == "± 20"


def test_google_benchmark(export):
    """The fields that its compare.py takes; a failure has none of its times."""
    found = json.loads(export("google-benchmark")[0])
    assert found["context"]["executable"].startswith("freepath ")
    by_name = {}
    for one in found["benchmarks"]:
        by_name.setdefault(one["name"], []).append(one)
    delta, ratio, wrong, slow = by_name.values()
    for ones, times in ((delta, TIMES["1"]), (ratio, TIMES["2"])):
        assert [one["real_time"] for one in ones] == pytest.approx([1e9 * t for t in times])
        assert [one["repetition_index"] for one in ones] == [0, 1, 2]
        for one in ones:
            assert one["cpu_time"] == one["real_time"]
            assert (one["time_unit"], one["run_type"], one["repetitions"]) == ("ns", "iteration", 3)
            assert one["iterations"] == PER_RAY // 3
    for (one,), told in ((wrong, "mismatch: off"), (slow, "timeout: hung")):
        assert (one["error_occurred"], one["error_message"]) == (True, told)
        assert "real_time" not in one


def test_t4(export):
    found = json.loads(export("t4")[0])
    jsonschema.validate(found, T4)
    delta, ratio, wrong, slow = found["results"]
    assert [one["invalidity"] for one in found["results"]] == [
        "correct", "correct", "correctness", "timeout",
    ]  # fmt: skip
    assert delta["configuration"] | {"tracker": "delta", "order": 2} == delta["configuration"]
    assert delta["times"]["runtimes"] == pytest.approx([1e3 * time for time in TIMES["1"]])
    assert delta["objectives"][0] in {one["name"] for one in delta["measurements"]}
    assert delta["objectives"][0] not in {one["name"] for one in ratio["measurements"]}
    assert wrong["correctness"] == slow["correctness"] == 0


def test_pyperf(result, export, tmp_path):
    assert main(["export", str(result), "--format", "pyperf", "-o", str(tmp_path / "p.json")]) == 0
    suite = pyperf.BenchmarkSuite.load(str(tmp_path / "p.json"))
    assert [one.get_name() for one in suite.get_benchmarks()] == [
        " ".join(name.split()) for name in names_of(result)
    ]
    for one, times in zip(suite.get_benchmarks(), TIMES.values(), strict=False):
        assert one.get_values() == pytest.approx(times)
        assert one.get_unit() == "second"
    assert "no such" not in export("pyperf", "--only", "/delta/")[1]


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["--format", "xml"], 2, "invalid choice: 'xml'"),
        (["--format", "bmf", "--only", "none"], 5, "matches 'none'"),
        (["--format", "bmf", "--only", "/slow/"], 2, "nothing can be exported:"),
        (["--format", "bmf", "--only", "("], 2, "expected a regular expression"),
        (["--format", "bmf", "-o", "no/where.json"], 2, "cannot write no/where.json"),
    ],
)
def test_mistakes(result, capsys, arguments, code, told):
    try:
        found = main(["export", str(result), *arguments])
    except SystemExit as ended:
        found = ended.code
    assert (found, told in capsys.readouterr().err) == (code, True)
    assert main(["export", str(result.parent), "--format", "t4"]) == 2
    assert "expected the folder of a run" in capsys.readouterr().err
