"""That predicted errors are measured, and that a wrong prediction would be seen."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from freepath import cli
from freepath.measure import confirm
from freepath.measure.stats import Moments
from freepath.results.folder import CONFIRM_COLUMNS, read_rows
from freepath.show import table

pytestmark = pytest.mark.slow

SWEEP = """\
name: small
seed: 3
rays: {orthographic: {resolution: [32, 32], direction: [0.1, 0.2, 1]}}
matrix:
  medium: [exponential: {sigma_t: 3, scale_height: 0.5}]
  tracker: [delta, ratio, {march: {step: 0.5}}]
stop: {error: 1%, time_noise: 50%, at_most: 1 s}
"""
RAYS, SECONDS = 256, 1e-6


class NormalRunner:
    """Scores that are normal about 0.5 + bias, at a fixed time a sample."""

    rays, lanes_in_all = RAYS, 32

    def __init__(self, bias=0.0, slower=1.0):
        self.random = np.random.default_rng(5)
        self.bias, self.slower, self.taken = bias, slower, []

    def run(self, first, samples, blocks=1):
        self.taken.append((first, samples * blocks))
        noise = self.random.normal(size=(blocks, RAYS)) * 0.2 / math.sqrt(samples)
        return SimpleNamespace(
            means=0.5 + self.bias + noise,
            time_per_sample_s=self.slower * SECONDS,
            time_s=self.slower * SECONDS * RAYS * samples * blocks,
        )


class Disturbed(NormalRunner):
    """A third of its rounds take twice as long."""

    def run(self, first, samples, blocks=1):
        self.slower = 1.0 + (self.random.random() < 1 / 3)
        return super().run(first, samples, blocks)


class RareRunner(NormalRunner):
    """Errors nearly all of which are of few estimates."""

    def run(self, first, samples, blocks=1):
        one = super().run(first, samples, blocks)
        high = self.random.random(blocks) < 0.05
        one.means = 0.5 + (one.means - 0.5) * np.where(high, 30.0, 1.0)[:, None]
        return one


def rows_of(runner, **row):
    row = {
        "estimate": 0.5,
        "reference": 0.5,
        "variance": 0.04,
        "bias_rms": 0.0,
        "time_per_sample_s": SECONDS,
        "time_to_1pct_s": 1.0,
    } | row
    moments = Moments(1000, np.zeros(RAYS), np.zeros(RAYS))
    bench = SimpleNamespace(
        timed=runner, measurement=SimpleNamespace(moments=moments, time_device_s=0.0)
    )
    return confirm.confirmed_rows(row, bench, np.full(RAYS, 0.5))


def texts(rows):
    return [{name: "" if v is None else str(v) for name, v in row.items()} for row in rows]


@pytest.mark.parametrize("slower", [1.0, 3.0])
def test_a_right_prediction_is_confirmed_whatever_the_pace(slower):
    rows = rows_of(NormalRunner(slower=slower))
    assert [row["samples_per_ray"] for row in rows] == sorted({r["samples_per_ray"] for r in rows})
    for row in rows:
        assert row["repeats"] >= confirm.REPEATS
        assert row["drift"] == pytest.approx(slower)
        assert row["time_s"] == pytest.approx(row["samples_per_ray"] * SECONDS)
        assert row["rmse_predicted"] == pytest.approx(0.2 / math.sqrt(row["samples_per_ray"]))
        # a 95 % interval, and 4 of its standard errors
        width = (row["rmse_high"] - row["rmse_low"]) / 2
        assert abs(row["rmse_measured"] - row["rmse_predicted"]) < 2 * width
        assert width < 0.03 * row["rmse_measured"]


def test_disturbed_rounds_do_not_move_a_prediction():
    rows = rows_of(Disturbed())
    for row in rows:
        assert row["drift"] == pytest.approx(1.0)
        assert row["time_s"] == pytest.approx(row["samples_per_ray"] * SECONDS)


@pytest.mark.parametrize(
    ("runner", "turns"),
    [(NormalRunner(), confirm.TURNS), (RareRunner(), confirm.MOST * confirm.TURNS)],
)
def test_it_goes_on_until_errors_are_known_or_enough_is_spent(runner, turns):
    rows_of(runner)
    assert len(runner.taken) == 4 * turns


@pytest.mark.parametrize("change", [{"variance": 0.05}, {"bias_rms": 0.02}, {"variance": 0.03}])
def test_a_wrong_prediction_is_seen(change):
    rows = texts(rows_of(NormalRunner(), **change))
    assert max(map(table.off, rows)) > table.CLOSE


def test_a_bias_that_was_not_seen_is_measured():
    rows = texts(rows_of(NormalRunner(bias=0.02)))
    assert max(map(table.off, rows)) > table.CLOSE
    rows = texts(rows_of(NormalRunner(bias=0.02), bias_rms=0.02))
    assert max(map(table.off, rows)) < table.CLOSE


def test_no_sample_is_used_twice():
    runner = NormalRunner()
    rows_of(runner)
    # the rounds beside them only tell the time: they may share samples with the repeats
    repeats = [taken for i, taken in enumerate(runner.taken) if i % 4]
    ends = [first + count for first, count in repeats]
    assert repeats[0][0] == 1000
    assert [first for first, _ in repeats[1:]] == ends[:-1]


@pytest.mark.parametrize(
    ("rays", "seconds"), [(1, 1e-7), (1024, 1e-8), (4096, 1e-4), (10**6, 1e-6)]
)
def test_counts_suit_the_case(rays, seconds):
    counts = confirm.repeats_of(rays, 32, seconds)
    assert len({one.samples for one in counts}) == 3
    for one in counts:
        assert 1 <= one.samples <= confirm.SAMPLES_PER_UNIT
        assert one.blocks * rays >= confirm.UNITS_PER_LANE * 32
        assert one.blocks * confirm.TURNS >= confirm.REPEATS


def test_an_unknown_variance_predicts_nothing():
    rows = rows_of(NormalRunner(), time_to_1pct_s=None)
    assert {row["rmse_predicted"] for row in rows} == {None}
    assert table.off(texts(rows)[0]) == math.inf


def test_run_confirm(work, selector, capsys):
    (work / "small.yaml").write_text(SWEEP)
    arguments = ["run", "small.yaml", "-d", selector, "-o", "out", "--confirm"]
    assert cli.main(arguments) == 0
    printed = capsys.readouterr().out
    assert "prediction within 10 % for " in printed
    assert "of 3 cases" in printed
    rows = read_rows(work / "out" / "confirm.csv", CONFIRM_COLUMNS)
    assert len(rows) == 9
    for row in rows:
        low, measured, high = (float(row[f"rmse_{what}"]) for what in ("low", "measured", "high"))
        assert 0 < low <= measured <= high
        # on a machine with other work, time is what makes it uncertain
        assert 0.5 < float(row["rmse_predicted"]) / measured < 2
        if row["tracker"] == "march":
            assert table.off(row) < 1e-3
    # what confirming takes is in no row, but no time outside the device
    spent = sum(float(row["time_device_s"]) for row in read_rows(work / "out" / "summary.csv"))
    told = json.loads((work / "out" / "run.json").read_text())["sessions"][-1]["time_device_s"]
    assert told > spent + 3 * confirm.BUDGET_S
    before = (work / "out" / "confirm.csv").read_bytes()
    assert cli.main([*arguments, "--resume"]) == 0
    assert (work / "out" / "confirm.csv").read_bytes() == before


def test_what_was_not_confirmed_runs_again(work, selector, capsys):
    (work / "small.yaml").write_text(SWEEP)
    arguments = ["run", "small.yaml", "-d", selector, "-o", "out", "-a", "tracker=march"]
    assert cli.main(arguments) == 0
    assert not (work / "out" / "confirm.csv").exists()
    assert cli.main([*arguments, "--resume", "--confirm"]) == 0
    assert len(read_rows(work / "out" / "confirm.csv", CONFIRM_COLUMNS)) == 3
    assert cli.main([*arguments, "--resume"]) == 0
    assert len(read_rows(work / "out" / "confirm.csv", CONFIRM_COLUMNS)) == 3
