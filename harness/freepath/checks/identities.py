"""What must hold for samples of any tracker, as checks that a wrong kernel fails.

Each takes `alpha`, the chance with which it may reject a right kernel, and shares it out over the
tests that it makes itself. None looks at how the kernel works, so that a tracker from elsewhere is
checked as the project's own are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from freepath.checks.verdict import demand, require
from freepath.measure.runner import Round
from freepath.measure.stats import RARE, Moments

Array = NDArray[np.float64]

RESOLVED = 0.05  # relative standard error of a mean that says something
EVENTS = 16  # of a ray, at least, that can show whether samples depend on each other
GROUPS = 8  # of rays with like expectations: errors of thin and of thick rays must not cancel
NO_EVENTS = np.zeros(2)


def _p_values(off: Array, square_error: Array, events: Array) -> Array:
    """Two-sided z-tests of sums that are `off` by so much, with independent errors.

    Rare events that did not come in a ray are not in its `square_error` either. If they are all
    that a sum is off by, they are as many as that over what one adds to it, and their variance is
    the product: the score test of a Poisson rate, where a Wald test has far too many small
    p-values. What did not come pulls the other way: `events` are (below, above), of which a sum
    that is too low lacks the latter. So a bias away from a long tail has nothing to hide behind.
    """
    event = np.where(off > 0.0, events[0], events[1])
    off = np.abs(off)
    return 2.0 * stats.norm.sf(off / np.sqrt(square_error + event * off))


def _require_groups(
    measured: Array, expected: Array, square_error: Array, events: Array, test: tuple[float, str]
) -> None:
    """Tests of sums over all rays, and over groups of rays, that share a level by Sidak 1967.

    His inequality holds for normal variables however they depend on each other, as the sum of all
    does on those of groups. All together see a bias that every ray shares, groups one that cancels.
    Each group has the same share of all noise: a group of rays on which hardly anything happens
    would have no normal distribution, nor a sample of its variance.
    """
    alpha, what = test
    order = np.argsort(expected, kind="stable")
    share = np.cumsum(square_error[order])
    if share[-1] == 0.0:
        demand((measured == expected).all(), f"{what}: without variance, and not as expected")
        return
    group = np.minimum((GROUPS * share / share[-1]).astype(int), GROUPS - 1)

    def summed(values: Array) -> Array:
        """Of all rays first, then of each group."""
        return np.append(values.sum(), np.bincount(group, values[order], GROUPS))

    rays, square = summed(np.ones(len(order))), summed(square_error)
    there = square > 0.0
    # a sum of differences, as that of two sums would lose its digits where all is nearly 1
    p_values = _p_values(summed(measured - expected)[there], square[there], events)
    found, wanted = (summed(values)[there] / rays[there] for values in (measured, expected))
    require(p_values, alpha, what, found, wanted)


def check_each_ray(moments: Moments, expected: Array, events: Array, alpha: float) -> None:
    """z-tests of single rays, but for the roundings of a hundred collisions."""
    off = moments.mean - expected
    off = np.sign(off) * np.maximum(np.abs(off) - 1e-5 * expected, 0.0)
    # what is not off is not divided by a variance of 0
    error = np.maximum(moments.variance / moments.count, np.finfo(float).tiny)
    p_values = _p_values(off, error, events / moments.count)
    require(p_values, alpha, "mean of a ray", moments.mean, expected)


def check_clean(one: Round, *, bounded: bool, violations: int = 0) -> None:
    """Nothing capped, nothing infinite, and no violation of a majorant that bounds.

    But for so many as rounding may explain, see `violations_by_rounding`.
    """
    watched = ("truncated", "nonfinite", "violations") if bounded else ("truncated", "nonfinite")
    found = {name: one.counters[name] for name in watched}
    if 0 < found.get("violations", 0) <= violations:
        found["violations"] = 0
    demand(not any(found.values()), f"none of these may be counted: {found}")


def violations_by_rounding(lookups: int, voxels: int, rounding: float, alpha: float) -> int:
    """How many lookups may be of the voxel next to the cell of the majorant that they belong to.

    Where voxels are constant and cells end with them. A place along an axis of so many voxels is
    rounded by that many times `rounding`, and a voxel has a plane on three axes.
    """
    return int(stats.poisson.isf(alpha, 3.0 * lookups * voxels * rounding))


def noise_of(moments: Moments, expected: Array) -> float:
    """Standard error of the mean over all rays, relative to what is expected."""
    return float(np.sqrt((moments.variance / moments.count).sum()) / expected.sum())


def check_mean(moments: Moments, expected: Array, alpha: float, events: Array = NO_EVENTS) -> None:
    """z-tests of the mean of all rays and of each group.

    They must be able to show something: weights that explode would hide behind their own variance.
    `events` is how much a rare one adds to a score, where that is known: see `largest_events`.
    """
    square_error = moments.variance / moments.count
    noise = noise_of(moments, expected)
    demand(noise < RESOLVED, f"mean: known to {noise:.2g} only")
    _require_groups(moments.mean, expected, square_error, events / moments.count, (alpha, "mean"))


def largest_events(scores: Array) -> Array:
    """How large the deviations (rays, samples) below and above the mean are that make a ray vary.

    The largest of all rays. Each weighs what it adds to the variance. So of a ray on which
    something happens now and then it is the size of that, however rare.
    """
    deviation = scores - scores.mean(axis=1, keepdims=True)
    square = np.einsum("rs,rs->r", deviation, deviation)
    square = np.where(square > 0.0, square, np.inf)
    sides = np.maximum(-deviation, 0.0), np.maximum(deviation, 0.0)
    cubes = (np.einsum("rs,rs,rs->r", one, one, one) for one in sides)
    return np.array([(cube / square).max() for cube in cubes])


def check_count(counts: Array, expected: Array, alpha: float) -> None:
    """z-tests of the mean of whole numbers (rays, samples), such as lookups."""
    samples = counts.shape[1]
    square_error, events = counts.var(axis=1, ddof=1) / samples, largest_events(counts) / samples
    _require_groups(counts.mean(axis=1), expected, square_error, events, (alpha, "count"))


def check_variance(scores: Array, expected: Array, alpha: float) -> None:
    """z-tests of the variance of scores (rays, samples).

    The variance of a sample variance is (m4 - s^4 (n - 3) / (n - 1)) / n; the fourth central
    moment m4 comes from the samples, which must therefore not have too heavy a tail.
    """
    count = scores.shape[1]
    deviation = scores - scores.mean(axis=1, keepdims=True)
    squares = deviation**2
    square = squares.sum(axis=1) / (count - 1)
    fourth = (squares**2).mean(axis=1)
    error = np.maximum(fourth - square**2 * (count - 3) / (count - 1), 0.0) / count
    events = largest_events(squares) / count
    _require_groups(square, expected, error, events, (alpha, "variance"))


def check_empty(moments: Moments, depth: Array, rounding: float) -> None:
    """Nothing is lost along a ray through nothing, but for a rounding or two.

    Next-flight estimators and the like vary in empty space too; of them those rays are looked at
    that did not, where what comes once in more than `count` samples may not have come.
    """
    empty, varied = depth == 0.0, moments.m2 > 0.0
    lost = np.max(np.abs(1.0 - moments.mean[empty & ~varied]), initial=0.0)
    unseen = RARE / moments.count if (empty & varied).any() else 0.0
    demand(lost <= 4.0 * rounding + unseen, f"empty space takes {lost:.2g}")


def check_independence(scores: Array, alpha: float) -> None:
    """Samples (rays, samples) have nothing to do with those of other rays, nor with each other.

    If they had not, sums over rays would vary more or less than each ray does, and neighbouring
    samples of a ray would correlate. Every ray counts alike, or the one of the largest variance
    might be all there is; a ray of a few high scores shows nothing, wherever they happen to be.
    """
    deviation = scores - scores.mean(axis=1, keepdims=True)
    squares = deviation**2
    variance = squares.mean(axis=1, keepdims=True)
    squares /= np.where(variance > 0.0, variance, np.inf)
    # n equal scores among zeros have a kurtosis of count / n
    kurtosis = np.square(squares).mean(axis=1)
    told = (kurtosis > 0.0) & (kurtosis < scores.shape[1] / EVENTS)
    deviation = deviation[told] / np.sqrt(variance[told])
    rays, count = deviation.shape
    if rays < 2:
        return
    # as many sums as samples, each normal for many rays: their squares add up to a chi-square
    square = (deviation.sum(axis=0) ** 2).mean() / rays * (count - 1)
    tails = stats.chi2.cdf(square, count - 1), stats.chi2.sf(square, count - 1)
    serial = np.einsum("rs,rs->", deviation[:, 1:], deviation[:, :-1]) / np.sqrt(rays * count)
    p_values = np.minimum([2.0 * min(tails), 2.0 * stats.norm.sf(abs(serial))], 1.0)
    require(p_values, alpha, "independence (of rays, of samples)")


def check_inversion(
    depth_at: Array, target: Array, escaped: NDArray[np.bool_], depth: Array, bound: Array
) -> None:
    """Each path ends where its sampled optical depth `target` is reached, up to `bound`.

    For trackers that draw the depth first: an analytic one with the same seed says what it was.
    """
    sure = np.abs(target - depth[:, None]) > bound[:, None]
    wrong = sure & (escaped != (target > depth[:, None]))
    demand(
        not wrong.any(), f"{np.count_nonzero(wrong)} paths end on the wrong side of the ray's end"
    )
    error = np.where(escaped, 0.0, np.abs(depth_at - target)) / bound[:, None]
    demand(
        error.max() <= 1.0, f"a free path is off by {error.max():.3g} times the bound of rounding"
    )


def roundings(pieces: Array) -> Array:
    """How many roundings of the size of majorant x length an optical depth has at most.

    `pieces` counts the parts of each ray that it is summed over. Each adds at most eight: three to
    where it starts and as many to where it ends, one of its product and one of the sum. A closed
    form adds at most 64: 16 of erf (OpenCL 7.4), 8 of sin, cos and exp, and up to 32 of arguments
    of size 16.
    """
    return 8.0 * pieces + 64.0


def check_exact(
    moments: Moments, expected: Array, rounding: float, depth: Array, pieces: Array
) -> None:
    """An estimator without variance returns the transmittance up to rounding.

    `depth` bounds the optical depth of each ray from above by majorant x length. Roundings add up
    in the worst case, and as a random walk on average over the rays.
    """
    demand(not moments.m2.any(), "an estimator that claims to be exact varies")
    scale = rounding * np.maximum(depth, 1.0)
    error = np.abs(moments.mean - expected) / np.maximum(expected, 1e-30)  # far below: underflow
    worst = np.max(error / (roundings(pieces) * scale))
    demand(worst <= 1.0, f"error {worst:.3g} times the bound of rounding")
    average = np.sqrt(np.mean((error / scale) ** 2 / roundings(pieces)))
    demand(average <= 1.0, f"error {average:.3g} times that of random rounding")


def check_free_path(
    depth_at: Array, escaped: NDArray[np.bool_], depth: Array, alpha: float, bins: int = 64
) -> None:
    """Chi-square and Kolmogorov-Smirnov tests of free paths against F = 1 - exp(-tau(t)).

    `depth_at` is the exact optical depth tau(t) at the end of each sample (rays, samples), `depth`
    that of the whole ray. Of the paths that do not escape, F / F(length) is uniform whatever the
    ray; how many escape is a test of its own. Both together are the chi-square test with an escape
    bin, exact also for rays of different depth. Uniforms are multiples of 2^-24, far below what
    the tests resolve.
    """
    collided = ~escaped
    empty = depth == 0.0
    demand(not collided[empty].any(), "a collision in nothing")
    share = np.expm1(-depth_at) / np.where(empty, -1.0, np.expm1(-depth))[:, None]
    values = share[collided]
    observed = np.histogram(np.clip(values, 0.0, 1.0), bins, (0.0, 1.0))[0]
    expected = values.size / bins
    escape = np.exp(-depth)
    excess = escaped.sum() - escaped.shape[1] * escape.sum()
    spread = escaped.shape[1] * (escape * (1.0 - escape)).sum()
    square = ((observed - expected) ** 2 / expected).sum()
    square += excess**2 / spread if spread > 0.0 else 0.0 if excess == 0.0 else np.inf
    p_values = [stats.chi2.sf(square, bins), stats.kstest(values, "uniform").pvalue]
    require(np.array(p_values), alpha, "free path (chi-square, KS)")


def check_weighted_free_path(
    depth_at: Array, weight: Array, escaped: NDArray[np.bool_], depth: Array, alpha: float
) -> None:
    """z-tests of the weight that ends in each of equally probable bins of F, and of what escapes.

    For trackers whose flights have another distribution than free paths, and weights that make up
    for it. In empty space such weights may cancel without end; most bins must say something.
    """
    bins = 16
    rays = depth > 0.0
    depth_at, weight, escaped = depth_at[rays], weight[rays], escaped[rays]
    share = np.expm1(-depth_at) / np.expm1(-depth[rays])[:, None]
    place = np.where(escaped, bins, np.clip(bins * share, 0, bins - 1).astype(int))
    escape = np.exp(-depth[rays])
    # of each ray: the sum of the weights that end in each bin, and of their squares
    count, cells = weight.shape[1], (len(weight), bins + 1)
    cell = (np.arange(len(weight))[:, None] * (bins + 1) + place).ravel()
    total, squares = (
        np.bincount(cell, values.ravel(), cells[0] * cells[1]).reshape(cells)
        for values in (weight, weight**2)
    )
    variance = (squares - total**2 / count) / (count - 1)
    expected = np.where(np.arange(bins + 1) < bins, (1.0 - escape)[:, None] / bins, escape[:, None])
    deviation = (total / count - expected).sum(axis=0)
    error = np.sqrt(variance.sum(axis=0) / count)
    noise = error / expected.sum(axis=0)
    p_values = 2.0 * stats.norm.sf(np.abs(deviation) / error)
    demand(np.median(noise) < 5.0 * RESOLVED, f"free path: bins known to {np.median(noise):.2g}")
    require(p_values, alpha, "free path (weighted)")


def check_same_samples(one: Array, other: Array, lookups: tuple[Array, Array], rounding: float):
    """The same paths: equal lookups but for fewer than 1 in 1e5, and equal scores up to rounding.

    The last bit of a logarithm may decide about a collision, which is then another path. Elsewhere
    a product of up to a hundred factors, each with a few roundings, is left to differ.
    """
    other_path = lookups[0] != lookups[1]
    differing = np.count_nonzero(other_path)
    demand(differing < 1e-5 * other_path.size, f"{differing} of {other_path.size} paths differ")
    scale = np.maximum(np.abs(one), np.abs(other))
    distance = np.abs(one - other)[~other_path]
    bad = distance > 1000.0 * rounding * np.maximum(scale[~other_path], rounding)
    demand(np.count_nonzero(bad) < 1e-5 * other_path.size, f"{np.count_nonzero(bad)} scores differ")
    error = abs(one.mean() - other.mean())
    flips = (differing + np.count_nonzero(bad)) / other_path.size
    demand(
        error <= 1000.0 * rounding * scale.mean() + flips * scale.max(), f"means differ by {error}"
    )


def check_order(steps: Array, bias: Array, order: float, tolerance: float) -> None:
    """The bias falls as steps^order: the slope of its logarithm, by least squares."""
    slope = float(np.polyfit(np.log(steps), np.log(np.abs(bias)), 1)[0])
    text = f"converges at order {slope:.3f}, expected {order} +- {tolerance}"
    demand(abs(slope - order) <= tolerance, text)
