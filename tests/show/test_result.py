"""The result object, and what Python is told that passes something else."""

import math
import re

import numpy as np
import pytest

import freepath
from freepath import config
from freepath.compose import catalog
from freepath.errors import ConfigError, FreepathError, NothingMatchedError, UsageError
from freepath.results.folder import COLUMNS
from freepath.show import answers
from freepath.show.report.text import sentences
from freepath.show.result import COLUMNS as FIRST
from support.rows import result_of, row_of


@pytest.fixture
def result(tmp_path):
    """At 1 %: ratio is 4 times as fast as delta; one is not settled, one is wrong."""
    rows = [
        row_of(1, "delta", seconds=4e-6),
        row_of(2, "ratio", 2.0, 3e-6),
        row_of(3, "ratio", seconds=1e-6),
        row_of(4, "lucky", seconds=1e-9, variance_noise=""),
        row_of(5, "wrong", seconds=1e-9, status="mismatch", reason="off"),
        row_of(6, "march", seconds=1e-7, bias="0.0", bias_rms="0.1", time_to_1pct_s="inf"),
    ]
    return freepath.load(result_of(tmp_path / "six", rows))


def records(table):
    return table if isinstance(table, list) else table.to_dict("records")


def test_cases_are_a_dozen_columns_and_summary_all(result):
    assert len(result) == 6
    cases, summary = records(result.cases), records(result.summary)
    assert tuple(cases[0]) == FIRST
    assert len(FIRST) == 12
    assert [row["tracker_label"] for row in cases] == [
        "ratio", "ratio", "delta", "lucky", "march", "wrong",
    ]  # fmt: skip
    assert tuple(summary[0]) == COLUMNS
    assert [row["case_id"] for row in summary] == list("123456")
    assert summary[0]["variance"] == 0.25
    assert math.isinf(cases[4]["time_to_1pct_s"])
    assert cases[0]["time_to_1pct_noise"] == pytest.approx(math.hypot(0.02, 0.02))


def test_the_best_and_ratios_are_those_of_the_sentence(result):
    best = result.best(0.01)
    assert (best.tracker, best.tightness, best.time_s) == ("ratio", 1.0, pytest.approx(0.01))
    # twice the error takes a quarter of the time; at 30 % the bias of marching has room
    assert result.best(0.02).time_s == pytest.approx(0.0025)
    assert result.best(0.3).tracker == "march"
    found = result.ratio("ratio", "delta")
    assert found.times == pytest.approx(4.0)
    assert (found.low, found.high) == answers.ratio(found.other, found.one)[1:]
    (sentence,) = result.sentences
    assert str(found) in sentence.replace("At 1 %: ", "")
    assert sentence == sentences(result._report)[0]
    assert result.ratio("ratio/auto.*", "/t2/ratio/").times == pytest.approx(3.0)
    assert [result.only("/t2/").best().tightness, len(result.only("/t2/"))] == [2.0, 1]


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (
            lambda r: r.ratio("rtio", "delta"),
            "no case has the name .* 'rtio'; did you mean 'ratio'",
        ),
        (lambda r: r.ratio("lucky", "delta"), "not known at 1 %: 'lucky': its variance"),
        (lambda r: r.ratio("march", "delta"), "not known at 1 %: 'march': never reaches it"),
        (lambda r: r.ratio("wrong", "delta"), "not known at 1 %: 'wrong': never reaches it"),
        (lambda r: r.ratio("(", "delta"), r"expected a tracker or a regular expression, got '\('"),
        (lambda r: r.best(5), "accuracy: expected a relative RMSE such as 0.01, got 5"),
        (lambda r: r.best("1%"), "accuracy: expected a relative RMSE such as 0.01, got '1%'"),
        (lambda r: r.only("lucky").best(), "the variance of no case is settled"),
        (lambda r: r.only("nothing"), "no case of .* matches 'nothing'"),
        (lambda r: r.only(3), "only: expected a regular expression, got 3"),
        (lambda r: r.chart("cots"), "expected one of cost, .* got 'cots'; did you mean 'cost'"),
    ],
)
def test_what_is_not_known_or_not_there_is_refused(result, ask, told):
    with pytest.raises(FreepathError, match=told):
        ask(result)


def test_of_several_questions_one_is_chosen(tmp_path):
    rows = [
        row_of(i, name, medium=m) for i, (name, m) in enumerate([("delta", "a"), ("ratio", "b")])
    ]
    rows = [row | {"case": row["case"].replace("cloud-64", row["medium"])} for row in rows]
    found = freepath.load(result_of(tmp_path / "two", rows))
    with pytest.raises(FreepathError, match="2 questions .*transmittance of a; transmittance of b"):
        found.best()
    assert found.only("/b/").best().tracker == "ratio"
    assert len(found.sentences) == 2
    with pytest.raises(NothingMatchedError):
        found.only("/b/").only("/a/")


def test_it_shows_itself(result):
    assert repr(result).splitlines()[1] == result.sentences[0]
    page = result._repr_html_()
    assert page.count("<tr>") == 7
    assert all(f"<td>{text}</td>" in page for text in ("ratio, global x2", "mismatch"))
    drawn = result.only("ratio").chart("cost").to_dict()
    assert {row["label"] for data in drawn["datasets"].values() for row in data} == {"ratio"}


def loaded(given, **axes):
    return config.load(given, catalog.load().parameter_models(), axes)


def test_a_config_may_be_a_dictionary():
    given = {
        "name": "x",
        "matrix": {
            "medium": {"homogeneous": {"sigma_t": np.float32(1.5)}},
            "tightness": np.array([1, 2]),
            "tracker": ("delta", {"march": {"step": 0.1}}),
        },
    }
    found = loaded(given)
    assert found.matrix.tightness == (1, 2)
    assert found.matrix.medium[0].sigma_t == 1.5
    assert (found.text, found.path, found.search_path) == ("", None, [])
    given["matrix"]["tracker"] = ["delta", {"march": {"stepp": 0.1}}]
    with pytest.raises(ConfigError, match=r"^config: matrix.tracker\[1\].stepp: .*'step'"):
        loaded(given)
    given["matrix"]["tracker"] = ["delta", len]
    with pytest.raises(
        ConfigError, match=r"^config: matrix.tracker\[1\]: expected a text, .*got bu"
    ):
        loaded(given)


def test_a_run_from_python(work, selector):
    given = {
        "name": "x",
        "rays": {"orthographic": {"resolution": [4, 4]}},
        "matrix": {"medium": {"homogeneous": {"sigma_t": 1}}, "tracker": ["delta", "ratio"]},
        "stop": {"samples": 64, "rounds": 4},
    }
    told = []
    options = {"devices": selector, "axes": {"tracker": "delta"}}
    found = freepath.run(given, "out", progress=lambda *what: told.append(what), **options)
    assert [row["tracker_label"] for row in records(found.cases)] == ["delta"]
    assert told
    compared = freepath.compare(found, "out", times=False)
    assert compared.verdicts == {"SAME": 1}
    assert str(compared).endswith("out: 1 SAME")
    assert "<td>SAME</td>" in compared._repr_html_()


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: freepath.run(42), "config: expected a path, the name of a config or a dict"),
        (lambda: freepath.run("quikc"), "did you mean 'quick'"),
        (lambda: freepath.run("quick", devices=[3]), r"devices: expected a text or .*got \[3\]"),
        (lambda: freepath.run("quick", axes=7), "axes: expected a text or a list of texts, got 7"),
        (lambda: freepath.load(3), "result: expected the folder of a run, got 3"),
        (lambda: freepath.load("none"), "none: expected the folder of a run"),
        (lambda: freepath.compare("a", "b", alpha=2), "alpha: expected a share .*got 2"),
        (lambda: freepath.compare("a", "b", drift="1%"), "drift: expected a ratio .*got '1%'"),
        (lambda: freepath.compare("a", 3), "contender: expected a result or its folder, got 3"),
        (
            lambda: freepath.compare(freepath.load("a").only("delta"), "b"),
            "reference: expected a whole result, not of `only`",
        ),
        (lambda: freepath.compare("a", "b", faktor=2), "expected arguments of alpha.*'faktor'"),
        (lambda: freepath.recommend(3), "volume: expected the path of a volume, got 3"),
        (lambda: freepath.recommend("a", accuracy=1), "accuracy: expected a relative RMSE.*got 1"),
        (lambda: freepath.recommend("a", estimand="x"), "estimand: expected one of.*got 'x'"),
        (lambda: freepath.recommend("a", renderer="x"), "renderer: expected one of.*got 'x'"),
        (lambda: freepath.recommend("a", budget=0), "budget: expected a number above 0, got 0"),
        (lambda: freepath.recommend("none.npy"), "none.npy: no such file"),
        (lambda: freepath.try_tracker("none.cl"), "none.cl: expected a tracker's .cl file"),
        (lambda: freepath.try_tracker("a.cl", lik="b"), "expected arguments of like.*got 'lik'"),
    ],
)
def test_errors_name_what_was_passed(work, call, told):
    for name in "ab":
        result_of(work / name, [row_of(1, "delta")])
    with pytest.raises(FreepathError, match=told) as caught:
        call()
    assert isinstance(caught.value, (UsageError, FreepathError))
    assert re.search(r"expected|no such file", str(caught.value))
