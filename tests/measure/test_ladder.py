import math

import pytest

from freepath.measure.ladder import Ladder


@pytest.mark.parametrize("bias", [0.0, 0.003])
@pytest.mark.parametrize("time_s", [2e-6, 1.0, 1e4])
def test_the_error_after_a_time_is_reached_in_that_time(bias, time_s):
    ladder = Ladder(bias, 0.25, 1e-6)
    assert ladder.rmse_after(time_s) ** 2 == pytest.approx(bias**2 + 0.25e-6 / time_s)
    assert ladder.time_to(ladder.rmse_after(time_s)) == pytest.approx(time_s)


def test_one_sample_is_the_least_and_a_bias_may_be_too_large():
    assert Ladder(0.0, 0.25, 7.0).time_to(1.0) == 7.0
    assert Ladder(0.1, 0.25, 7.0).time_to(0.1) == math.inf
    # without variance the bias is all
    assert Ladder(0.1, 0.0, 7.0).time_to(0.1) == 7.0
    assert Ladder(0.1, 0.0, 7.0).time_to(0.099) == math.inf
