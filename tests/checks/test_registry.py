"""The registry: what must hold for every check that is in it."""

import pytest

from checks.support import CHECKS
from freepath.checks import registry
from freepath.checks.model import BUDGET, GROUPS, LABELS, LEVEL, MOST_CHECKS
from freepath.compose import catalog
from freepath.errors import NothingMatchedError, UsageError


def test_names_are_unique_and_fit_for_a_command_line():
    names = [check.name for check in CHECKS]
    assert len(set(names)) == len(names)
    assert all(set(name) <= set("abcdefghijklmnopqrstuvwxyz0123456789/._-") for name in names)


def test_the_budget_is_enough_for_all():
    assert len(CHECKS) <= MOST_CHECKS
    assert pytest.approx(BUDGET) == 1 - (1 - LEVEL) ** MOST_CHECKS


def test_labels_are_known_and_say_how_fast():
    trackers = set(catalog.load().trackers)
    for check in CHECKS:
        assert set(check.labels) <= set(LABELS) | trackers
        assert len({"fast", "slow"} & set(check.labels)) == 1
        assert check.sentence.endswith(".")


def test_there_are_hard_cases_of_every_group_and_tracker():
    hard = [check for check in CHECKS if "hard" in check.labels]
    assert len(hard) >= 100
    found = {label for check in hard for label in check.labels}
    assert set(GROUPS) <= found
    assert set(catalog.load().trackers) - {"lookup_only"} <= found


def test_selection():
    chosen = registry.Selection("^hard/", "grid", ["thick|thin", "^ratio$"], ["slow"]).of(CHECKS)
    for number, check in chosen:
        assert CHECKS[number - 1] is check
        assert check.name.startswith("hard/th")
        assert "ratio" in check.labels
        assert "slow" not in check.labels
    assert chosen


def test_nothing_matched():
    with pytest.raises(NothingMatchedError, match="no tests matched"):
        registry.Selection("no such check").of(CHECKS)
    with pytest.raises(UsageError, match="expected a regular expression"):
        registry.Selection("(").of(CHECKS)
