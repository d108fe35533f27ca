"""Variances of few runs are steadied by their neighbours: no more than these allow."""

import numpy as np
import pytest
from scipy import stats

from freepath.show.compare.moderation import moderated

FREEDOM = 4.0


def drawn(truth, seed):
    random = np.random.default_rng(seed)
    return truth * random.chisquare(FREEDOM, len(truth)) / FREEDOM


def test_equal_variances_are_told_by_all_of_them():
    errors, alone = [], []
    for seed in range(50):
        found = drawn(np.full(40, 9.0), seed)
        variances, freedoms = moderated(found, np.full(40, FREEDOM))
        assert (freedoms > FREEDOM).all()
        assert (freedoms <= 40 * FREEDOM).all()
        errors.append(np.abs(np.log(variances / 9.0)).mean())
        alone.append(np.abs(np.log(found / 9.0)).mean())
    assert np.mean(errors) < 0.25 * np.mean(alone)


def test_variances_that_have_nothing_in_common_do_not_shrink():
    found = drawn(10.0 ** np.linspace(-12, 12, 60), 1)
    variances, freedoms = moderated(found, np.full(60, FREEDOM))
    assert (variances > 0.9 * found).all()
    assert np.abs(np.log(variances / found))[30:].max() < 0.1
    assert freedoms.max() < 1.2 * FREEDOM


def test_of_few_cases_nothing_is_told():
    found, freedoms = np.array([1.0, 2.0, 0.0]), np.array([2.0, 2.0, 2.0])
    assert moderated(found, freedoms) == (pytest.approx(found), pytest.approx(freedoms))


@pytest.mark.parametrize("spread", [0.0, 0.5, 2.0])
def test_a_test_by_them_holds_its_level(spread):
    """Means of normal errors whose variances differ by exp(spread x normal), at 1 %."""
    random, alarms, tries = np.random.default_rng(7), 0, 0
    for _ in range(300):
        truth = np.exp(spread * random.normal(size=16))
        found = truth * random.chisquare(FREEDOM, 16) / FREEDOM
        variances, freedoms = moderated(found, np.full(16, FREEDOM))
        scores = np.sqrt(truth) * random.normal(size=16) / np.sqrt(variances)
        alarms += int((2 * stats.t.sf(np.abs(scores), freedoms) < 0.01).sum())
        tries += 16
    # fitted to 16 cases the two parameters are not exact: twice the level is allowed, no more
    assert stats.binomtest(alarms, tries, 0.02, alternative="greater").pvalue > 0.01
