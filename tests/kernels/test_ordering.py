"""Unbiased estimators at equal lookups: the order that docs/estimators.md gives them."""

import numpy as np
import pytest
from scipy import stats

from freepath.checks.verdict import sidak

# One ray down an exponential atmosphere, many times.
LINES = (np.full((64, 3), (0.3, 0.4, 0.0)), np.full((64, 3), (0.0, 0.0, 1.0)))
SAMPLES = 8192
# Optical depth and scale height; then what gives each tracker about as many lookups a sample: the
# tightness of ratio tracking and of unbiased marching, and the steps of telescoping marching.
CASES = [
    (1.0, 1.0, 28.0, (17.7, 1.0, 8)),
    (1.0, 1.0, 57.0, (36.0, 4.0, 16)),
    (1.0, 0.2, 56.0, (11.1, 1.3, 16)),
    (8.0, 1.0, 92.0, (7.3, 1.0, 25)),
]
ALPHA = sidak(1e-3, 2 * len(CASES))


def cost(flight):
    """Lookups a sample, and variance x lookups with its standard error."""
    samples = flight.record(SAMPLES)
    deviation = samples.score.ravel() - samples.score.mean()
    variance, fourth = (deviation**2).mean(), (deviation**4).mean()
    lookups = samples.lookups.mean()
    error = np.sqrt((fourth - variance**2) / deviation.size)
    return lookups, lookups * variance, lookups * error


@pytest.mark.parametrize(("depth", "height", "lookups", "settings"), CASES)
def test_telescoping_then_marching_then_ratio(rig, depth, height, lookups, settings):
    densest = depth / (height * -np.expm1(-1.0 / height))
    axes = {"medium": {"exponential": {"sigma_t": densest, "scale_height": height}}}
    axes |= {"lanes": 16, "lines": LINES}
    ratio, marching, steps = settings
    costs = [
        cost(rig.flight(tracker={"telescoping_march": {"steps": steps}}, **axes)),
        cost(rig.flight(tracker="unbiased_march", tightness=marching, **axes)),
        cost(rig.flight(tracker="ratio", tightness=ratio, **axes)),
    ]
    for each, _, _ in costs:
        assert each == pytest.approx(lookups, rel=0.06)
    for (_, low, low_error), (_, high, high_error) in zip(costs, costs[1:], strict=False):
        p_value = stats.norm.sf((high - low) / np.hypot(low_error, high_error))
        assert p_value < ALPHA, f"variance x lookups: {low:.3g}, expected less than {high:.3g}"
