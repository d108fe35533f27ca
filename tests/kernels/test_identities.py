"""Every tracker x medium x majorant x estimand agrees with float64 in the mean."""

import pytest
from freepath import catalog
from support.cases import cases_of, check_case, name_of
from support.identities import sidak

CASES = [axes for tracker in catalog.load().trackers.values() for axes in cases_of(tracker)]
ALPHA = sidak(1e-3, len(CASES))


@pytest.mark.parametrize("axes", CASES, ids=name_of)
def test_mean(rig, axes):
    check_case(rig, axes, ALPHA)
