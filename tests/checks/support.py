"""The checks of `freepath check` as tests: one each."""

import pytest

from freepath.checks import registry
from freepath.checks.model import LEVEL
from freepath.checks.verdict import NotApplicable
from freepath.compose import catalog

CHECKS = registry.checks(catalog.load())


def those(*prefixes):
    """A test for each check whose name begins so."""
    chosen = [check for check in CHECKS if check.name.startswith(prefixes) and check.in_tests]
    assert chosen

    @pytest.mark.parametrize("check", chosen, ids=lambda check: check.name)
    def test(rig, check):
        reason = check.reason_against(rig.device.info)
        if reason:
            pytest.skip(reason)
        try:
            check.run(rig, LEVEL)
        except NotApplicable as error:
            pytest.skip(str(error))

    return test
