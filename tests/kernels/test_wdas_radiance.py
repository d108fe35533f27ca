"""Trackers of radiance agree with each other on a production cloud, pixel by pixel."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from freepath.checks.verdict import require

FILE = "wdas_cloud_sixteenth.vdb"
FOLDERS = [Path(part) for part in os.environ.get("FREEPATH_VOLUMES", "").split(os.pathsep) if part]
FOUND = next((path for folder in FOLDERS for path in folder.rglob(FILE)), None)
ALPHA = 1e-3
SAMPLES = 256
TRACKERS = ("weighted_delta", "regular", "decomposition")


@pytest.mark.skipif(FOUND is None, reason=f"{FILE} is not in $FREEPATH_VOLUMES")
def test_pixel_by_pixel(rig):
    keys = {"file": str(FOUND), "sigma_t": 0.05, "albedo": 0.999, "g": 0.8}
    axes = {
        "estimand": "radiance",
        "medium": {"volume": keys},
        "majorant": {"grid": {"resolution": [16, 11, 20]}},
        "light": {"uniform": {"radiance": 1}},
        "scatterings": 64,
        "rays": {"orthographic": {"resolution": 16, "direction": [0, 0, 1]}},
        "lanes": 16,
    }
    flights = {name: rig.flight(tracker=name, **axes) for name in ("delta", *TRACKERS)}
    moments = {
        name: flight.run(SAMPLES, first_sample=SAMPLES * place).moments
        for place, (name, flight) in enumerate(flights.items())
    }
    one = moments.pop("delta")
    p_values = []
    for other in moments.values():
        error = np.sqrt((one.variance + other.variance) / SAMPLES)
        # of pixels beside the cloud every sample is the environment's radiance
        seen = error > 1e-6
        assert np.count_nonzero(seen) > 50
        z = (one.mean - other.mean)[seen] / error[seen]
        p_values.append(2 * stats.norm.sf(np.abs(z)))
        p_values.append([2 * stats.norm.sf(abs(z.sum()) / np.sqrt(len(z)))])
    require(np.concatenate(p_values), ALPHA, "pixels")
