"""The error of a mean over channels; the checks of the group channels do more."""

import numpy as np

SAMPLES = 4096
CHANNELS = (1.0, 0.6, 0.25)
MEDIUM = {"homogeneous": {"sigma_t": 1.5, "channels": CHANNELS}}


def spectral(rig):
    tracker = {"spectral": {"probability": "history_average"}}
    return rig.flight(tracker=tracker, medium=MEDIUM, lanes=16)


def test_the_error_of_the_mean_knows_that_channels_are_correlated(rig):
    samples = spectral(rig).record(SAMPLES)
    moments = samples.round.moments
    expected = samples.scores.mean(axis=0).var(axis=1, ddof=1)
    np.testing.assert_allclose(moments.joint_variance, expected, rtol=1e-3)
    independent = moments.variance.mean(axis=1) / len(CHANNELS)
    assert moments.joint_variance.mean() > 1.2 * independent.mean()
    halves = [spectral(rig).run(SAMPLES // 2, first_sample=first) for first in (0, SAMPLES // 2)]
    merged = halves[0].moments.merged(halves[1].moments)
    np.testing.assert_allclose(merged.joint_variance, expected, rtol=1e-3)
