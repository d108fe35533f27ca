"""Mean, variance and cost of delta and ratio tracking, in every medium with either majorant."""

import itertools

import numpy as np
import pytest

from freepath.checks.identities import check_count, check_mean, check_variance
from freepath.checks.media import MAJORANTS, MEDIA
from freepath.checks.truth import MajorantAlongRays
from freepath.checks.verdict import sidak

SAMPLES = 4096
# Beyond this optical depth the weights of ratio tracking have so heavy a tail that the variance of
# a sample says little about the variance.
THICKEST = 2.0

CASES = list(itertools.product(("delta", "ratio"), MEDIA, MAJORANTS, (1.5,)))
# Numbers do not change a kernel: these cost samples alone. Delta needs a bound.
CASES += itertools.product(("delta", "ratio"), ("exponential",), ("grid",), (1, 1.25, 2, 4, 10))
CASES += itertools.product(("ratio",), ("exponential",), ("grid",), (0.5, 0.8))
# three checks of each case
ALPHA = sidak(1e-3, 3 * len(CASES))


@pytest.mark.parametrize(("tracker", "medium", "majorant", "tightness"), CASES)
def test_closed_forms(rig, tracker, medium, majorant, tightness):
    # lanes go round as in test_identities, for kernels that both can use
    turn = list(MEDIA).index(medium) + list(MAJORANTS).index(majorant)
    flight = rig.flight(
        tracker=tracker,
        medium=medium,
        majorant=majorant,
        tightness=tightness,
        lanes=(16, 1)[turn % 2],
    )
    expected = EXPECTED[tracker](flight)
    depth = flight.medium.optical_depth(flight.segments)
    thin = depth <= THICKEST
    assert np.count_nonzero(thin) > 100
    samples = flight.record(SAMPLES)
    check_mean(samples.round.moments, flight.reference(), ALPHA)
    check_variance(samples.score[thin], expected["variance"][thin], ALPHA)
    check_count(samples.lookups, expected["lookups"], ALPHA)
    assert samples.lookups.sum() == samples.round.counters["lookups"]


def delta(flight):
    transmittance = flight.reference()
    return {
        "variance": transmittance * (1.0 - transmittance),
        "lookups": along(flight).collisions_until_real(),
    }


def ratio(flight):
    depth = flight.medium.optical_depth(flight.segments)
    majorant = along(flight)
    return {
        "variance": np.exp(-2.0 * depth) * np.expm1(majorant.square_over_majorant()),
        "lookups": majorant.tentative_collisions(),
    }


EXPECTED = {"delta": delta, "ratio": ratio}


def along(flight):
    case = flight.case
    return MajorantAlongRays(case.majorant, flight.medium, case.tightness, flight.segments)
