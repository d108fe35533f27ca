"""What once went wrong, with the seed that showed it."""

import pytest

from freepath.checks.identities import check_clean


@pytest.mark.parametrize("tracker", ["residual_ratio", "weighted_decomposition"])
def test_nothing_collides_with_a_majorant_of_nothing(rig, tracker):
    """Where the control is the extinction nothing is left to collide with.

    With this seed one path in a million met such a cell with a draw that rounding had made
    negative, and became no number.
    """
    octree = {"octree": {"resolution": 8}}
    flight = rig.flight(tracker=tracker, medium="trilinear", majorant=octree, lanes=16, seed=6)
    check_clean(flight.run(4096), bounded=False)
