"""Ray marching converges at its order, and to what it should be at each step."""

import numpy as np
import pytest

from freepath.checks.identities import check_mean, check_order
from freepath.checks.truth import depth_at
from freepath.checks.verdict import sidak
from freepath.scene.special import NODES, WEIGHTS

# Smooth and curved along every ray: where sigma_t has kinks the order is another.
MEDIUM = {"gaussian": {"sigma_t": 3.0, "width": 0.4, "center": [0.4, 0.6, 0.3]}}
RAYS = {"chords": {"count": 64}}
STEPS = np.array([1 / 8, 1 / 16, 1 / 32, 1 / 64])
ALPHA = sidak(1e-3, 16)


def marched(rig, estimand, placement, step, **options):
    tracker = {"march": {"step": float(step), "placement": placement}}
    return rig.flight(
        tracker=tracker,
        medium=MEDIUM,
        rays=RAYS,
        estimand=estimand,
        arithmetic="double",
        lanes=4,
        **options,
    )


def steps_of(flight, step):
    """Start and length of the steps along each ray, (rays, steps); those beyond its end are 0."""
    length = flight.segments[:, 6, None]
    edges = np.minimum(step * np.arange(np.ceil(length.max() / step) + 1), length)
    return edges[:, :-1], np.diff(edges, axis=1)


def extinction(flight, t):
    points = flight.segments[:, None, :3] + t[..., None] * flight.segments[:, None, 3:6]
    return flight.medium.sigma_t(points.reshape(-1, 3)).reshape(t.shape)


def marched_transmittance(flight, step, placement):
    """What marching should return on average: of independent steps a product of expectations."""
    start, length = steps_of(flight, step)
    if placement == "jittered":
        factors = sum(
            weight * np.exp(-length * extinction(flight, start + node * length))
            for node, weight in zip(NODES, WEIGHTS, strict=True)
        )
        return factors.prod(axis=1)
    if placement == "comb":
        depths = [
            (length * extinction(flight, start + node * length)).sum(axis=1) for node in NODES
        ]
        return sum(w * np.exp(-depth) for w, depth in zip(WEIGHTS, depths, strict=True))
    share = {"start": 0.0, "midpoint": 0.5}[placement]
    return np.exp(-(length * extinction(flight, start + share * length)).sum(axis=1))


@pytest.mark.parametrize(
    ("placement", "order"), [("start", 1), ("midpoint", 2), ("jittered", 3), ("comb", 2)]
)
def test_transmittance(rig, placement, order):
    """Each step size gives what it should to the last digits, and that converges at the order.

    The bias of jittered steps is a thousandth of their noise: so it is measured against what
    quadrature says of it, whose own order is then that of the kernel.
    """
    bias = []
    for step in STEPS:
        flight = marched(rig, "transmittance", placement, step)
        expected = marched_transmittance(flight, step, placement)
        if placement in ("jittered", "comb"):
            check_mean(flight.run(2000).moments, expected, ALPHA)
        else:
            found = flight.run(2).moments
            assert not found.m2.any()
            np.testing.assert_allclose(found.mean, expected, rtol=1e-13)
        bias.append(np.sqrt(np.mean((expected - flight.reference()) ** 2)))
    # at these steps the next order adds up to a tenth
    check_order(STEPS, np.array(bias), order, tolerance=0.1)


def test_jitter_removes_the_second_order(rig):
    """Seen in samples alone: at one large step, where a bias of third order is above the noise."""
    flight = marched(rig, "transmittance", "jittered", 0.5)
    moments = flight.run(40_000, 4).moments
    bias = (moments.mean - flight.reference()).sum()
    error = np.sqrt((moments.variance / moments.count).sum())
    expected = (marched_transmittance(flight, 0.5, "jittered") - flight.reference()).sum()
    assert expected > 20 * error
    assert abs(bias - expected) < 5 * error


@pytest.mark.parametrize(("placement", "order"), [("start", 1), ("midpoint", 2), ("jittered", 2)])
def test_free_path(rig, placement, order):
    """The mean free path converges too.

    The analytic tracker draws the same optical depths from the same seed: the noise of their
    difference falls with the step. Within a step the path goes by one extinction for all of it,
    which costs jittered steps an order.
    """
    exact = rig.flight(
        tracker="analytic",
        medium=MEDIUM,
        rays=RAYS,
        estimand="free_path",
        arithmetic="double",
        lanes=4,
    )
    exact_t = exact.record(8192).t
    bias = []
    for step in STEPS:
        t = marched(rig, "free_path", placement, step).record(8192).t
        bias.append((t - exact_t).mean())
    check_order(STEPS, np.array(bias), order, tolerance=0.15)


@pytest.mark.parametrize("placement", ["start", "midpoint"])
def test_each_free_path(rig, placement):
    """Where the extinction is one a step, a path ends where their sum reaches the sampled depth."""
    step = STEPS[0]
    flight = marched(rig, "free_path", placement, step)
    samples = flight.record(512)
    exact = rig.flight(
        tracker="analytic",
        medium=MEDIUM,
        rays=RAYS,
        estimand="free_path",
        arithmetic="double",
        lanes=4,
    )
    truth = exact.record(512)
    both = ~samples.escaped & ~truth.escaped
    sampled = depth_at(exact.medium, exact.segments, truth.t)
    start, length = steps_of(flight, step)
    share = {"start": 0.0, "midpoint": 0.5}[placement]
    sigma = extinction(flight, start + share * length)
    inside = np.clip(samples.t[..., None] - start[:, None], 0.0, length[:, None])
    flown = (inside * sigma[:, None]).sum(axis=-1)
    assert both.mean() > 0.2
    # the analytic tracker inverts by Newton's method, to a few units in the last place
    np.testing.assert_allclose(flown[both], sampled[both], rtol=1e-10, atol=1e-13)
