"""The derived second moments themselves: closed forms, all outcomes, and what a slip does."""

from itertools import combinations, product
from math import prod

import numpy as np
import pytest

from freepath.checks.identities import check_variance
from freepath.checks.verdict import Failure
from support import march_moments
from support.derivations import AlongRays, TrackLength, delta
from support.march_moments import COEFFICIENTS, Telescoping, UnbiasedMarch, square_of_order

TELESCOPING = {"telescoping_march": {"steps": 1, "ratio": 0.1}}


def along_rays(rig, tracker, medium, **axes):
    return AlongRays(rig.flight(tracker=tracker, medium=medium, lanes=16, **axes))


@pytest.mark.parametrize("tightness", [1, 1.25, 4])
def test_track_length_in_a_homogeneous_medium(rig, tightness):
    """There the segments add up to the length flown, at most that of the ray."""
    along = along_rays(rig, "track_length", "homogeneous", tightness=tightness)
    found = TrackLength(delta(along))
    depth = along.depth
    variance = found.moment(2) - found.moment(1) ** 2
    np.testing.assert_allclose(found.moment(1), np.exp(-depth), rtol=0, atol=1e-6)
    exact = -np.expm1(-2.0 * depth) - 2.0 * depth * np.exp(-depth)
    np.testing.assert_allclose(variance, exact, rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize(
    ("tracker", "derivation"), [("unbiased_march", UnbiasedMarch), (TELESCOPING, Telescoping)]
)
def test_marches_of_a_homogeneous_medium_have_no_variance(rig, tracker, derivation):
    found = derivation(along_rays(rig, tracker, "homogeneous"))
    assert abs(found.moment(2) - found.moment(1) ** 2).max() < 1e-13


def power_series(depths):
    """What the paper writes, for the combs of one sample: a mean over pivots."""
    total = 0.0
    for pivot, x in enumerate(depths):
        others = [x - y for i, y in enumerate(depths) if i != pivot]
        for k in range(len(depths)):
            subsets = [prod(chosen) for chosen in combinations(others, k)]
            total += np.exp(-x) * COEFFICIENTS[k] * np.mean(subsets)
    return total / len(depths)


@pytest.mark.parametrize("order", range(5))
def test_power_series_against_all_outcomes(order):
    values, chances = np.array([0.2, 0.9, 1.7]), np.array([0.5, 0.3, 0.2])
    expected = sum(
        np.prod(chances[list(each)]) * power_series(values[list(each)]) ** 2
        for each in product(range(3), repeat=order + 1)
    )
    away = values - chances @ values
    found = square_of_order(
        order,
        chances @ away**2,
        lambda p: chances @ (np.exp(-values) * away**p),
        lambda p: chances @ (np.exp(-2.0 * values) * away**p),
    )
    assert found == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("level", [0, 1])
@pytest.mark.parametrize("medium", ["exponential", "cosine"])
def test_antithetic_difference_against_all_outcomes(rig, medium, level):
    """Every coin, and a product of quadratures over the places of all lookups."""
    along = along_rays(rig, TELESCOPING, medium)
    depth, weights = march_moments.depths(along, 2 ** (level + 1))
    places, weights = (12, np.full(12, 1 / 12)) if level else (len(weights), weights)
    depth = depth[:6, :, :: depth.shape[2] // places][:, :, :places]
    grids = [np.stack(np.meshgrid(*each, indexing="ij")) for each in depth]
    measure = prod(np.ix_(*[weights] * 2 ** (level + 1)))
    expected = []
    for grid in grids:
        squares = []
        for coins in product((0, 1), repeat=2**level):
            one = sum(grid[2 * i + coin] for i, coin in enumerate(coins))
            fine = np.exp(-grid.sum(axis=0))
            coarse = 0.5 * (np.exp(-2.0 * one) + np.exp(-2.0 * (grid.sum(axis=0) - one)))
            squares.append((measure * (fine - coarse) ** 2).sum())
        expected.append(np.mean(squares))
    found = Telescoping(along).difference(level, (depth, weights))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-18)


class HalfOfThePairs(TrackLength):
    """A segment is paired with later ones, but not they with it."""

    def paired(self):
        return 0.5 * super().paired()


class WithoutPlaces(TrackLength):
    """A segment's estimate without the variance of its random point."""

    def alone(self):
        along = self.chain.along
        return 2.0 * along.sigma * along.ahead(along.majorant, along.sigma)


class WithoutChance(Telescoping):
    """Differences that are divided by their chance once, not twice."""

    def difference(self, level, places=None):
        return super().difference(level, places) * (1.0 - self.ratio) * self.ratio**level


class WithoutShared(UnbiasedMarch):
    """Products of differences as if none had a comb in common."""

    def square(self, order, variance, once, twice):
        return super().square(order, 0.0 * variance, once, twice)


SLIPS = [
    ("track_length", lambda along: HalfOfThePairs(delta(along))),
    ("track_length", lambda along: WithoutPlaces(delta(along))),
    (TELESCOPING, WithoutChance),
    ("unbiased_march", WithoutShared),
]


@pytest.mark.parametrize(("tracker", "slip"), SLIPS)
def test_a_slip_in_a_derivation_is_noticed(rig, tracker, slip):
    """With fewer samples than those that hold the right derivation are tested with."""
    flight = rig.flight(tracker=tracker, medium="exponential", tightness=2, lanes=16)
    wrong = slip(AlongRays(flight))
    scores = flight.record(1024).score
    with pytest.raises(Failure, match="variance"):
        check_variance(scores, wrong.moment(2) - wrong.moment(1) ** 2, 1e-6)
