"""The cost of a walk through the medium, and that of a walk in equal steps."""

import numpy as np


def test_regular_and_march_look_up_once_a_piece(rig):
    regular = rig.flight(tracker="regular", medium="trilinear", lanes=1)
    pieces = regular.medium.pieces(regular.segments).length
    # rounding may make or miss a piece of all but no length, where a ray meets an edge
    least, most = (np.count_nonzero(pieces > limit, axis=1) for limit in (1e-5, 0.0))
    lookups = regular.record(2).lookups
    assert (lookups == lookups[:, :1]).all()
    assert ((least <= lookups[:, 0]) & (lookups[:, 0] <= most + 1)).all()

    march = rig.flight(
        tracker={"march": {"step": 0.125}}, medium="trilinear", lanes=1, majorant="global"
    )
    assert (march.record(2).lookups[:, 0] == np.ceil(march.segments[:, 6] / 0.125)).all()
