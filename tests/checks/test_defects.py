"""Each check is shown to fail: defects are planted in the kernels, one at a time."""

import pytest

from checks.support import CHECKS
from freepath.checks.defects import DEFECTS, Defect, caught
from freepath.checks.rig import Change

pytestmark = pytest.mark.slow

BY_NAME = {check.name: check for check in CHECKS}


@pytest.mark.parametrize("defect", DEFECTS, ids=lambda defect: defect.what)
def test_a_defect_is_caught(rig, defect):
    check = BY_NAME[defect.check]
    if check.applies(rig.device.info):
        pytest.skip(check.applies(rig.device.info))
    assert caught(rig, defect, check)


def test_there_are_thirty():
    assert len(DEFECTS) >= 30
    assert len({defect.what for defect in DEFECTS}) == len(DEFECTS)


def test_a_defect_without_its_place_is_an_error(rig):
    check = BY_NAME["hard/random-numbers/published/1-lanes"]
    with pytest.raises(LookupError, match="nothing with a place"):
        caught(rig, Defect("none", "no such text", "", check.name), check)
    with pytest.raises(LookupError, match="nothing with a place"):
        caught(rig, next(one for one in DEFECTS if one.function), check)
    with pytest.raises(LookupError, match="places"):
        rig.with_change(Change("path", "")).flight(tracker="ratio", medium="gaussian", lanes=1)
