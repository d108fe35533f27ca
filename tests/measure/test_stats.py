import math
import statistics

import numpy as np
import pytest
from scipy import stats

from freepath.measure.stats import (
    Accuracy,
    Moments,
    Tail,
    accuracy,
    merge_blocks,
    relative_half_width,
    squares_of,
)


def moments_of(scores):
    """Moments of scores of the shape (rays, samples)."""
    mean = scores.mean(1)
    return Moments(scores.shape[1], mean, ((scores - mean[:, None]) ** 2).sum(1))


@pytest.mark.parametrize("seed", range(8))
def test_merging_agrees_with_numpy_however_the_data_are_split(seed):
    random = np.random.default_rng(seed)
    scores = random.gamma(0.1, size=(5, 997)) + random.choice([0.0, 1e6])
    edges = np.unique(random.integers(1, 997, size=random.integers(1, 60)))
    parts = [moments_of(part) for part in np.split(scores, edges, axis=1)]
    merged = parts[0]
    for part in parts[1:]:
        merged = merged.merged(part)
    assert merged.count == 997
    np.testing.assert_allclose(merged.mean, scores.mean(1), rtol=1e-13)
    np.testing.assert_allclose(merged.variance, scores.var(1, ddof=1), rtol=1e-8)


@pytest.mark.parametrize("blocks", [1, 2, 3, 7, 120])
def test_blocks_agree_with_numpy(blocks):
    scores = np.random.default_rng(blocks).normal(3.0, 0.1, size=(4, 840))
    parts = [moments_of(part) for part in np.split(scores, blocks, axis=1)]
    merged = merge_blocks(
        np.array([part.mean for part in parts]),
        np.array([part.m2 for part in parts]),
        840 // blocks,
    )
    assert merged.count == 840
    np.testing.assert_allclose(merged.mean, scores.mean(1), rtol=1e-14)
    np.testing.assert_allclose(merged.variance, scores.var(1, ddof=1), rtol=1e-12)


@pytest.mark.parametrize("blocks", range(2, 40))
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_scores_that_are_all_the_same_have_no_variance(blocks, dtype):
    same = np.random.default_rng(blocks).random(50).astype(dtype)
    merged = merge_blocks(np.tile(same, (blocks, 1)), np.zeros((blocks, 50), dtype), 3)
    assert (merged.mean == same).all()
    assert (merged.merged(merged).variance == 0).all()


def test_half_width_of_students_interval():
    assert relative_half_width([1.0, 3.0]) == pytest.approx(12.7062047 * 1 / 2)
    five = [4.0, 5.0, 6.0, 5.0, 5.0]
    spread = statistics.stdev(five) / math.sqrt(5)
    assert relative_half_width(five) == pytest.approx(2.7764451 * spread / 5)
    assert relative_half_width([-1.0, -3.0]) == relative_half_width([1.0, 3.0])


def test_half_width_at_the_edges():
    assert relative_half_width([]) == relative_half_width([7.0]) == math.inf
    assert relative_half_width([0.1, 0.1, 0.1]) == 0.0
    assert relative_half_width([0.0, 0.0]) == 0.0
    assert relative_half_width([-1.0, 1.0]) == math.inf


def test_half_width_covers_as_often_as_it_says():
    draws = np.random.default_rng(1).normal(10.0, 2.0, size=(4000, 6))
    means = draws.mean(1)
    inside = [
        abs(mean - 10.0) <= relative_half_width(list(row)) * mean
        for mean, row in zip(means, draws, strict=True)
    ]
    assert np.mean(inside) == pytest.approx(0.95, abs=4 * math.sqrt(0.95 * 0.05 / 4000))


def tail_of(random, chances, scores, samples=1000):
    """The tail of 4000 units of scores, and how well it is said that their variance is known."""
    tail, variances = Tail(), []
    for _ in range(5):
        counts = random.multinomial(samples, chances, size=(200, 4))
        mean = counts @ scores / samples
        m2 = (counts * (scores - mean[..., None]) ** 2).sum(-1)
        tail.add(squares_of(mean[..., None], m2[..., None], samples))
        variances.append((m2.sum() + samples * ((mean - mean.mean()) ** 2).sum()) / counts.sum())
    return tail, relative_half_width(variances)


@pytest.mark.parametrize("samples", [100, 300, 1000, 3000, 10_000])
def test_weights_of_a_violated_majorant_are_not_known(samples):
    """weighted_delta at tightness 0.5: weights (-3)^k, k Poisson with a third of the mean.

    Their moments are exp(mean (sum of 1/3 (-3)^p - 1)) in closed form, mean = majorant x length.
    One standard error of the variance is far more than the variance, whatever rounds say.
    """
    random, mean, known = np.random.default_rng(5), 1.0, 0
    levels = np.arange(60)
    chances = stats.poisson.pmf(levels, mean / 3)
    second, fourth = (math.exp(mean * (3.0 ** (power - 1) - 1.0)) for power in (2, 4))
    first = math.exp(-2.0 * mean)
    variance = second - first**2
    error = math.sqrt(fourth / (4000 * samples)) / variance
    assert error > 1.0
    for _ in range(40):
        tail, noise = tail_of(random, chances / chances.sum(), (-3.0) ** levels, samples=samples)
        known += tail.told and noise < 1.0
    assert known <= 3  # of 40; by rounds alone all of them are known to a few percent


@pytest.mark.parametrize(
    ("chances", "scores"),
    [
        ([0.5, 0.5], [0.0, 1.0]),
        ([0.99, 0.01], [0.0, 1.0]),
        (stats.poisson.pmf(np.arange(30), 4.0), 0.5 ** np.arange(30.0)),
        (stats.poisson.pmf(np.arange(30), 1.0), 1.3 ** np.arange(30.0)),
    ],
)
def test_scores_of_a_finite_fourth_moment_are_known(chances, scores):
    random, chances = np.random.default_rng(6), np.array(chances)
    for _ in range(20):
        tail, noise = tail_of(random, chances / chances.sum(), np.array(scores))
        assert tail.told
        assert noise < 0.1


def test_what_does_not_vary_is_known():
    tail = Tail()
    assert tail.told
    tail.add(np.ones((3, 2)))
    assert tail.units == math.inf


def test_a_single_high_score_carries_all():
    squares = np.random.default_rng(7).gamma(50.0, size=(1000, 3))
    tail = Tail()
    tail.add(squares)
    assert tail.units == pytest.approx(1000, rel=0.15)  # a third of 3000
    other = Tail()
    squares[3, 1] += 1e6
    for part in np.split(squares, 4):
        other.add(part)
    assert other.units == pytest.approx(1.0, rel=0.02)
    assert not other.told


def test_accuracy_of_few_numbers():
    moments = Moments(4, np.array([1.0, 3.0]), np.array([3.0, 9.0]))
    found = accuracy(moments, np.array([0.5, 2.0]))
    assert (found.estimate, found.reference, found.bias) == (2.0, 1.25, 0.75)
    assert found.variance == 2.0  # the mean of 3 / 3 and 9 / 3
    assert found.bias_stderr == pytest.approx(math.sqrt(1 / 4 + 3 / 4) / 2)
    assert found.z_score == pytest.approx(0.75 / 0.5)
    assert found.samples == 8
    assert found.bias_rms == 0.0  # mean(0.25, 1) is not far above mean(0.25, 0.75)
    assert found.rmse == math.sqrt(2.0)


def test_estimators_without_variance_have_a_bias_and_no_z():
    found = accuracy(Moments(10, np.array([0.5, 0.7]), np.zeros(2)), np.array([0.4, 0.9]))
    assert found.z_score is None
    assert found.bias == pytest.approx(-0.05)
    assert found.bias_rms == pytest.approx(math.sqrt((0.01 + 0.04) / 2))
    assert found.rmse == found.bias_rms


def binary_runs(count, rays, samples, seed):
    """Accuracies of an unbiased estimator that returns 0 or 1, as delta tracking does."""
    random = np.random.default_rng(seed)
    chance = random.random(rays)
    for _ in range(count):
        mean = random.binomial(samples, chance) / samples
        yield accuracy(Moments(samples, mean, samples * mean * (1 - mean)), chance)


def test_z_scores_of_an_unbiased_estimator_are_normal():
    z = np.array([found.z_score for found in binary_runs(3000, 64, 200, seed=5)])
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=4 * math.sqrt(0.95 * 0.05 / 3000))
    assert abs(z.mean()) < 4 / math.sqrt(3000)
    assert z.std() == pytest.approx(1.0, abs=4 / math.sqrt(6000))


def test_an_unbiased_estimator_hardly_ever_shows_a_bias_of_its_rays():
    shown = [found.bias_rms > 0 for found in binary_runs(2000, 64, 200, seed=6)]
    assert np.mean(shown) < 0.005


def test_the_bias_of_rays_is_found_where_it_is_more_than_noise():
    random = np.random.default_rng(3)
    reference = random.random(400)
    bias = 0.05 * random.choice([-1, 1], 400)  # cancels in the mean
    scores = (reference + bias)[:, None] + random.normal(0, 0.2, size=(400, 100))
    found = accuracy(moments_of(scores), reference)
    assert found.bias_rms == pytest.approx(0.05, rel=0.1)
    assert abs(found.bias) < 0.01
    assert found.rmse == pytest.approx(math.hypot(0.2, 0.05), rel=0.05)


def result(**given):
    values = {
        "estimate": 0.5,
        "reference": 0.5,
        "bias": 0.0,
        "bias_stderr": 1e-3,
        "bias_rms": 0.0,
        "variance": 0.25,
        "samples": 1000,
    }
    return Accuracy(**values | given)


def test_time_to_an_error():
    # 0.25 / (0.01 * 0.5)^2 = 10 000 samples
    assert result().time_to(0.01, 2e-9) == pytest.approx(2e-5)
    # a bias of 0.003 leaves (0.005^2 - 0.003^2) = 0.004^2
    assert result(bias_rms=0.003).time_to(0.01, 1.0) == pytest.approx(0.25 / 0.004**2)
    assert result(bias_rms=0.005).time_to(0.01, 1.0) == math.inf
    assert result(bias_rms=0.3).time_to(0.01, 1.0) == math.inf


def test_time_to_an_error_takes_one_sample_at_least():
    assert result(variance=1e-9).time_to(0.01, 7.0) == 7.0
    assert result(variance=0.0).time_to(0.01, 7.0) == 7.0
    assert result(variance=0.0, bias_rms=0.004).time_to(0.01, 7.0) == 7.0
    assert result(variance=0.0, bias_rms=0.006).time_to(0.01, 7.0) == math.inf


def test_time_to_an_error_where_nothing_is_to_be_seen():
    assert result(estimate=0.0, reference=0.0, variance=0.0).time_to(0.01, 7.0) == 7.0
    assert result(reference=0.0).time_to(0.01, 7.0) == math.inf
    unseen = result(estimate=0.0, reference=1e-20, variance=0.0, bias=-1e-20, bias_rms=1e-20)
    assert unseen.time_to(0.01, 7.0) is None


def test_the_ladder_is_what_more_samples_give():
    found = result(bias_rms=0.002)
    seconds = found.time_to(0.01, 1e-6)
    samples = seconds / 1e-6
    assert math.sqrt(found.variance / samples + found.bias_rms**2) == pytest.approx(0.005)


def test_what_contradicts_a_reference():
    many = {"samples": 10**9, "bias_stderr": 1e-4}
    assert not result(bias=5e-4, **many).contradicted(1.0, 0.0)
    assert result(bias=7e-4, **many).contradicted(1.0, 0.0)
    assert result(bias=-7e-4, **many).contradicted(1.0, 0.0)
    assert not result(bias=7e-4, **many).contradicted(1.0, 1e-3)  # which rounding may cost
    assert result(bias=1.2e-3, **many).contradicted(1.0, 1e-3)


def test_an_estimator_without_variance_is_held_to_rounding():
    exact = {"variance": 0.0, "bias_stderr": 0.0, "samples": 2}
    assert not result(bias=4e-4, **exact).contradicted(1.0, 1e-3)
    assert result(bias=6e-4, **exact).contradicted(1.0, 1e-3)


def test_scores_too_rare_to_be_seen_contradict_nothing():
    nothing = {"estimate": 0.0, "variance": 0.0, "bias_stderr": 0.0, "samples": 10**6}
    assert not result(reference=1e-20, bias=-1e-20, **nothing).contradicted(1.0, 1e-3)
    assert not result(reference=1e-5, bias=-1e-5, **nothing).contradicted(1.0, 1e-3)
    assert result(reference=1e-4, bias=-1e-4, **nothing).contradicted(1.0, 1e-3)
    # scores of up to 1000 may miss a thousand times as much
    assert not result(reference=1e-4, bias=-1e-4, **nothing).contradicted(1e3, 1e-3)


def test_where_all_scores_must_be_0():
    nothing = {"estimate": 0.0, "reference": 0.0, "variance": 0.0, "bias_stderr": 0.0}
    assert not result(**nothing).contradicted(0.0, 1e-3)
    assert result(**nothing | {"estimate": 0.1, "bias": 0.1}).contradicted(0.0, 1e-3)


def test_skewed_scores_of_a_thick_medium_are_not_condemned():
    """Ratio tracking through a depth of 30: weights 1/2^k, whose spread few samples show."""
    random = np.random.default_rng(11)
    for _ in range(20):
        weights = 0.5 ** random.poisson(60, size=(1, 20_000))
        found = accuracy(moments_of(weights), np.array([math.exp(-30)]))
        assert not found.contradicted(1.0, 1e-3)
