"""Variance and cost of the null-collision relatives agree with docs/estimators.md."""

import numpy as np
import pytest
from freepath import majorants
from freepath.check.identities import check_count, check_mean, check_variance
from freepath.check.verdict import sidak

SAMPLES = 4096
POINTS = 2048  # of the midpoint rule along a ray: its error is far below that of the samples
THICKEST = 2.0  # heavier tails than at this optical depth are not for a sample variance

MEDIA = ("exponential", "trilinear")


class AlongRays:
    """sigma_t at midpoints of equal intervals of each ray, with the majorant and control there."""

    def __init__(self, flight):
        segments = flight.segments
        self.step = segments[:, 6:] / POINTS
        t = (np.arange(POINTS) + 0.5) * self.step
        points = segments[:, None, :3] + t[..., None] * segments[:, None, 3:6]
        self.sigma = flight.medium.sigma_t(points.reshape(-1, 3)).reshape(t.shape)
        case = flight.case
        control = case.params if "control" in flight.tracker.needs else None
        bounds = flight.medium.bounds((1, 1, 1))
        numbers = majorants.build(
            case.majorant, flight.medium, bounds, case.tightness, control
        ).numbers
        self.majorant = numbers.get("sigma_t", numbers.get("residual"))
        self.control = numbers.get("control", 0.0)

    def integral(self, values):
        return (values * self.step).sum(axis=1)

    def until(self, rate, end_rate):
        """The integral of a rate over the paths that an end rate has not ended."""
        ended = np.cumsum(end_rate * self.step, axis=1) - 0.5 * end_rate * self.step
        return self.integral(rate * np.exp(-ended))

    @property
    def transmittance(self):
        return np.exp(-self.integral(self.sigma))


def binary(along):
    rate = np.full_like(along.sigma, along.majorant)
    return along.transmittance, along.until(rate, along.sigma)


def ratio(along):
    square = along.integral(along.sigma**2 / along.majorant)
    return along.transmittance**2 * np.exp(square), along.integral(0 * along.sigma + along.majorant)


def free(acceptance, albedo=1.0):
    """two_knob: real collisions with odds acceptance * sigma / |sigma_n|."""

    def expected(along):
        null = np.abs(along.majorant - along.sigma)
        real = acceptance * albedo * along.sigma
        second = np.exp(along.integral(null * (real + null) / along.majorant - along.majorant))
        rate = np.full_like(along.sigma, along.majorant)
        return second, along.until(rate, along.majorant * real / (real + null))

    return expected


def residual_ratio(along):
    residual = along.sigma - along.control
    second = along.transmittance**2 * np.exp(along.integral(residual**2 / along.majorant))
    return second, along.integral(0 * along.sigma + along.majorant)


def decomposition(along):
    rate = np.full_like(along.sigma, along.majorant)
    return along.transmittance, along.until(rate, along.sigma)


def weighted_decomposition(along):
    residual = along.sigma - along.control
    null = np.abs(along.majorant - residual)
    both = np.abs(residual) + null
    second = np.exp(along.integral(null * both / along.majorant - along.majorant - along.control))
    rate = np.full_like(along.sigma, along.majorant)
    ends = along.control + along.majorant * np.abs(residual) / both
    return second, along.until(rate, ends)


def track_length_cost(along):
    rate = np.full_like(along.sigma, along.majorant)
    return None, 2.0 * along.until(rate, along.sigma) + along.transmittance


CASES = [
    ({"weighted_delta": {}}, 1.5, free(1.0)),
    ({"weighted_delta": {}}, 0.8, free(1.0)),
    ({"weighted_delta": {"probability": "analog"}}, 1.5, binary),
    ({"weighted_delta": {"probability": "no_absorption"}}, 1.5, free(1.0, albedo=0.8)),
    ({"two_knob": {"acceptance": 0.3}}, 1.5, free(0.3)),
    ({"two_knob": {"acceptance": 3}}, 1.5, free(3.0)),
    ({"split": {}}, 1.5, ratio),
    ({"residual_ratio": {}}, 1.5, residual_ratio),
    ({"residual_ratio": {"control": "minorant", "share": 1.2}}, 1.5, residual_ratio),
    ({"decomposition": {}}, 1.5, decomposition),
    ({"weighted_decomposition": {"share": 0.3}}, 1.5, weighted_decomposition),
    ({"next_flight_delta": {}}, 1.5, lambda along: (None, binary(along)[1])),
    ({"next_flight_ratio": {}}, 1.5, lambda along: (None, ratio(along)[1])),
    ({"track_length": {}}, 1.5, track_length_cost),
]
# mean, variance and lookups of each
ALPHA = sidak(1e-3, 3 * len(CASES) * len(MEDIA))


@pytest.mark.parametrize("medium", MEDIA)
@pytest.mark.parametrize(("tracker", "tightness", "expected"), CASES)
def test_mean_variance_and_lookups(rig, tracker, tightness, expected, medium):
    flight = rig.flight(tracker=tracker, medium=medium, tightness=tightness, lanes=16)
    along = AlongRays(flight)
    second, lookups = expected(along)
    samples = flight.record(SAMPLES)
    check_mean(samples.round.moments, flight.reference(), ALPHA)
    check_count(samples.lookups, lookups, ALPHA)
    thin = -np.log(along.transmittance) <= THICKEST
    if second is not None:
        variance = second - along.transmittance**2
        check_variance(samples.score[thin], variance[thin], ALPHA)


@pytest.mark.parametrize(
    ("tracker", "relative"),
    [
        ({"weighted_delta": {"probability": "analog"}}, "delta"),
        ({"split": {}}, "ratio"),
        ({"decomposition": {"share": 0}}, "delta"),
        ({"residual_ratio": {"share": 0}}, "ratio"),
    ],
)
def test_equal_to_its_relative_sample_for_sample(rig, tracker, relative):
    """What only changes in form must not change a single flight."""
    one, other = (
        rig.flight(tracker=t, medium="trilinear", majorant="grid", lanes=16).record(256)
        for t in (tracker, relative)
    )
    assert (one.lookups == other.lookups).mean() > 1 - 1e-5
    same = one.lookups == other.lookups
    np.testing.assert_allclose(one.score[same], other.score[same], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("tracker", ["delta", "decomposition", "track_length", "next_flight_delta"])
def test_a_lower_majorant_gives_the_predicted_bias(rig, tracker):
    """What plays sigma / majorant as a probability estimates exp(-integral of min(sigma, M))."""
    flight = rig.flight(tracker=tracker, medium="exponential", tightness=0.5, lanes=16)
    along = AlongRays(flight)
    samples = flight.record(SAMPLES)
    assert samples.round.counters["violations"] > 0
    if tracker in ("delta", "decomposition"):
        capped = np.minimum(along.sigma - along.control, along.majorant) + along.control
        check_mean(samples.round.moments, np.exp(-along.integral(capped)), ALPHA)
    bias = samples.round.moments.mean.mean() - flight.reference().mean()
    assert abs(bias) > 0.01


@pytest.mark.parametrize("majorant", ["grid", {"octree": {"resolution": 8}}])
@pytest.mark.parametrize("tracker", ["delta", "residual_ratio", "weighted_decomposition"])
def test_local_majorants_and_controls_keep_the_mean(rig, tracker, majorant):
    flight = rig.flight(tracker=tracker, medium="trilinear", majorant=majorant, lanes=16)
    check_mean(flight.record(SAMPLES).round.moments, flight.reference(), sidak(1e-3, 6))
