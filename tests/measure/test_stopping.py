import math
from dataclasses import replace

import numpy as np
import pytest

from freepath.measure.stats import relative_half_width
from freepath.measure.stopping import PATIENCE, PILOT_ROUNDS, Rule, Stopping

LOOSE = {"error": 1.0, "time_noise": 1.0, "at_most_s": math.inf}


def rounds_taken(rule, times, variances, seconds_a_round=1.0):
    """Follow a case until it stops; returns its rounds and why."""
    stopping = Stopping(rule)
    for taken in range(1, len(times) + 1):
        reason = stopping.reason(times[:taken], variances[:taken], taken * seconds_a_round)
        if reason:
            return taken, reason
    return len(times), ""


def steady(count=1000):
    return [1.0] * count


def noisy(count=1000, spread=0.1, seed=0):
    return np.random.default_rng(seed).normal(1.0, spread, count).tolist()


def test_the_pilot_rounds_are_always_made():
    assert rounds_taken(Rule(**LOOSE), steady(), steady()) == (PILOT_ROUNDS, "precise")


def test_a_budget_ends_everything():
    rule = Rule(error=1e-9, time_noise=1e-9, at_most_s=3.0)
    assert rounds_taken(rule, noisy(), noisy()) == (3, "budget")
    assert rounds_taken(rule, noisy(), noisy(), seconds_a_round=10.0) == (1, "budget")


def test_the_error_asks_for_as_many_rounds_as_the_pilot_says():
    variances = [1.0, 1.1, 0.9, 1.05, 0.95]
    mean_error = np.std(variances, ddof=1) / math.sqrt(5)
    half_width = 2.7764451 * mean_error / 2  # of the RMSE, the root of the variance
    rule = Rule(**LOOSE | {"error": 0.01})
    expected = math.ceil(5 * (half_width / 0.01) ** 2)
    assert expected > 50
    assert rounds_taken(rule, steady(), variances + steady()) == (expected, "precise")


def test_later_rounds_do_not_change_what_the_pilot_asked_for():
    pilot = [1.0, 1.1, 0.9, 1.05, 0.95]
    rule = Rule(**LOOSE | {"error": 0.02})
    assert rounds_taken(rule, steady(), pilot + steady()) == rounds_taken(
        rule, steady(), pilot + noisy(spread=0.5)
    )


def test_time_is_watched_until_it_is_known():
    rule = Rule(**LOOSE | {"time_noise": 0.02})
    taken, reason = rounds_taken(rule, noisy(), steady())
    assert reason == "precise"
    # 1.96 * 0.1 / sqrt(n) = 0.02
    assert taken == pytest.approx((1.96 * 0.1 / 0.02) ** 2, rel=0.4)


def test_an_estimator_without_variance_is_known_after_the_pilot():
    assert rounds_taken(Rule(**LOOSE | {"error": 1e-6}), steady(), [0.0] * 100) == (5, "precise")


def test_variances_that_are_no_numbers_do_not_ask_for_more():
    assert rounds_taken(Rule(**LOOSE), steady(), [math.nan] * 100) == (5, "precise")


def test_the_promised_precision_of_the_rmse_is_kept():
    """The RMSE that is left after stopping is within the interval asked for, 95 times of 100."""
    inside = []
    for seed in range(400):
        variances = noisy(2000, spread=0.2, seed=seed)
        taken, _ = rounds_taken(Rule(**LOOSE | {"error": 0.05}), steady(2000), variances)
        rmse = math.sqrt(np.mean(variances[:taken]))
        inside.append(abs(rmse - 1.0) <= 0.05)
    assert np.mean(inside) >= 0.95 - 3 * math.sqrt(0.95 * 0.05 / 400)


def rare(count=4000):
    """Variances of rounds: one in four holds rare high scores, one in twelve rarer ones."""
    ordinary = [10.0 if place % 4 == 3 else 1.0 for place in range(count)]
    return [100.0 if place % 12 == 11 else v for place, v in enumerate(ordinary)]


def test_a_prediction_to_confirm_is_measured_on_until_its_error_is_known():
    rule = Rule(**LOOSE | {"error": 0.5, "at_most_s": 6.0})
    assert rounds_taken(rule, steady(), rare()) == (6, "budget")
    patient = replace(rule.confirming(0.5), at_most_s=200.0)
    taken, reason = rounds_taken(patient, steady(4000), rare())
    assert reason == "precise"
    assert relative_half_width(rare()[:taken]) / 2 <= 0.5
    # what the pilot asked for was too few: they had not seen the rarest
    planned, _ = rounds_taken(replace(patient, patience=1), steady(4000), rare())
    assert taken in {planned * 2**power for power in range(1, 10)}


def test_patience_ends():
    rule = Rule(**LOOSE | {"at_most_s": 6.0}).confirming(0.01)
    assert rounds_taken(rule, steady(), rare()) == (6 * PATIENCE, "budget")


def test_patience_is_for_errors_not_for_times():
    rule = Rule(error=0.1, time_noise=1e-9, at_most_s=8.0).confirming(0.05)
    assert rounds_taken(rule, noisy(), steady()) == (8, "budget")


def test_confirming_asks_for_no_less_than_the_config():
    assert Rule(**LOOSE | {"error": 0.01}).confirming(0.05).error == 0.01
    assert Rule(**LOOSE).confirming(0.05).error == 0.05
