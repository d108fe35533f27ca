"""Rules of checks that are no tests of a distribution: what they let pass, and what they do not."""

from types import SimpleNamespace

import numpy as np
import pytest

from freepath.checks import cases
from freepath.checks.identities import (
    NO_EVENTS,
    _p_values,
    check_clean,
    check_empty,
    check_independence,
    check_mean,
    largest_events,
    violations_by_rounding,
)
from freepath.checks.verdict import Failure
from freepath.measure.stats import Moments

ROUNDING = 2.0**-24
COUNT = 2048


def through_nothing(mean, m2):
    return Moments(COUNT, np.array(mean), np.array(m2)), np.zeros(len(mean))


def test_a_ray_whose_rare_score_did_not_come_is_no_loss():
    # with a majorant's depth of 0.001 all of 2048 scores are exp(-0.001) in one run of eight
    found = through_nothing([np.exp(-0.001), 1.0003], [0.0, 0.2])
    check_empty(*found, ROUNDING)
    with pytest.raises(Failure, match="empty space takes"):
        check_empty(*through_nothing([np.exp(-0.02), 1.0003], [0.0, 0.2]), ROUNDING)


def test_what_does_not_vary_loses_nothing():
    check_empty(*through_nothing([1.0, 1.0], [0.0, 0.0]), ROUNDING)
    with pytest.raises(Failure, match="empty space takes"):
        check_empty(*through_nothing([np.exp(-0.001), 1.0], [0.0, 0.0]), ROUNDING)


def test_only_what_rounding_explains_may_violate_the_majorants_of_voxels():
    allowed = violations_by_rounding(10**6, 8, ROUNDING, 1e-6)
    assert 3 < allowed < 20
    assert violations_by_rounding(10**6, 8, 2.0**-53, 1e-6) == 0

    def found(violations, **others):
        counters = {"truncated": 0, "nonfinite": 0, "violations": violations} | others
        return SimpleNamespace(counters=counters)

    check_clean(found(1), bounded=True, violations=allowed)
    for one, more in ((found(1), 0), (found(allowed + 1), allowed), (found(1, truncated=1), 9)):
        with pytest.raises(Failure, match="none of these may be counted"):
            check_clean(one, bounded=True, violations=more)


@pytest.mark.parametrize(("variance", "blocks"), [(1.0, [1]), (4.0, [1, 8]), (100.0, [1, 8, 32])])
def test_a_mean_that_rare_weights_leave_unknown_gets_more_samples(variance, blocks):
    taken = []

    def record(samples, blocks=1):
        taken.append(blocks)
        moments = Moments(
            samples * blocks, np.array([1.0]), np.array([variance * samples * blocks])
        )
        return SimpleNamespace(round=SimpleNamespace(moments=moments), score=np.zeros((1, samples)))

    flight = SimpleNamespace(reference=lambda: np.array([1.0]), record=record)
    found = cases._resolved(flight, record(COUNT))
    assert taken == blocks
    assert found.round.moments.count == COUNT * blocks[-1]


RAYS, ALPHA = 128, 1e-6


def scores(seed, rays=RAYS, count=COUNT):
    """Skewed as those of rays of different depth are, some next to never and some often hit."""
    random = np.random.default_rng(seed)
    chance = np.geomspace(1e-3, 0.9, rays)[:, None]
    return (random.random((rays, count)) < chance) * random.exponential(size=(rays, count))


def test_two_high_scores_in_a_row_are_no_dependence():
    """The ray varies more than all others together: it was all that the test saw."""
    found = scores(1)
    found[0] = 1.0
    found[0, [5, 6, 90, 700, 1200]] = 100.0
    check_independence(found, ALPHA)


def test_no_ray_that_varies_is_nothing_to_test():
    check_independence(np.ones((RAYS, COUNT)), ALPHA)


def test_independence_is_rejected_as_often_as_it_says():
    rejected = 0
    for seed in range(400):
        try:
            check_independence(scores(seed, count=512), 0.05)
        except Failure:
            rejected += 1
    assert 6 <= rejected <= 40  # 20 expected; beyond has a chance of 1 in 10,000


def grazing(seed):
    """Rays that hardly vary, and a few like them that score 0 now and then, grazing a corner."""
    random = np.random.default_rng(seed)
    expected = random.uniform(0.998, 1.0, RAYS)
    found = expected[:, None] + 1e-3 * random.normal(size=(RAYS, COUNT))
    expected[:4] = 1.0 - 2.0 / COUNT
    found[:4] = random.random((4, COUNT)) >= 2.0 / COUNT
    return found, expected


def rejected_means(drawn, alpha, event=largest_events, bias=0.0):
    count = 0
    for found, expected in drawn:
        mean = found.mean(axis=1) + bias
        m2 = ((found - mean[:, None]) ** 2).sum(axis=1)
        try:
            check_mean(Moments(found.shape[1], mean, m2), expected, alpha, event(found))
        except Failure:
            count += 1
    return count


def drawn_scores(times):
    chance = np.geomspace(1e-3, 0.9, RAYS)
    return ((scores(seed), chance) for seed in range(times))


def test_a_rare_score_that_did_not_come_between_quiet_rays_is_no_bias():
    drawn = [grazing(seed) for seed in range(200)]
    assert rejected_means(drawn, 1e-3) <= 2
    assert rejected_means(drawn, 1e-3, lambda found: NO_EVENTS) > 20  # not knowing how large one is


def test_means_are_rejected_at_most_as_often_as_it_says():
    assert 1 <= rejected_means(drawn_scores(200), 0.05) <= 25  # 10 expected; 1 in 10,000 beyond


def weighed(times):
    """Scores with a long tail, as of products of weights: of a mean of 1 and a variance of 6."""
    for seed in range(times):
        normal = np.random.default_rng(seed).normal(size=(RAYS, COUNT))
        yield np.exp(1.4 * normal - 0.98), np.ones(RAYS)


@pytest.mark.parametrize("bias", [0.05, -0.05])
def test_a_bias_of_all_rays_is_found(bias):
    assert rejected_means(weighed(10), ALPHA, bias=bias) == 10


def test_a_bias_of_all_rays_is_found_in_their_sum():
    for found, expected in weighed(5):
        mean = found.mean(axis=1) + 0.05
        moments = Moments(COUNT, mean, ((found - mean[:, None]) ** 2).sum(axis=1))
        with pytest.raises(Failure, match="in part 0 of 9"):
            check_mean(moments, expected, ALPHA, largest_events(found))


def test_what_did_not_come_explains_a_loss_and_no_gain():
    found = np.ones((RAYS, COUNT))
    found[0, 0] = 50.0
    events = largest_events(found)
    assert events[0] < 0.1
    assert events[1] > 48.0
    error = np.full(2, found[0].var() / COUNT)
    loss, gain = _p_values(np.array([-0.2, 0.2]), error, events / COUNT)
    assert gain < 1e-10
    assert loss > 1e-3


@pytest.mark.parametrize("shared", [0.3, 1.0])
def test_rays_that_share_their_numbers_are_found(shared):
    found = scores(2)
    cut = int(shared * COUNT)
    found[1::2, :cut] = found[::2, :cut]
    with pytest.raises(Failure, match="independence"):
        check_independence(found, ALPHA)


def test_samples_that_share_their_numbers_are_found():
    found = scores(3)
    found[:, 1:200:2] = found[:, :200:2]
    with pytest.raises(Failure, match="independence"):
        check_independence(found, ALPHA)
