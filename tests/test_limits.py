import dataclasses

import numpy as np
import pytest
from freepath import limits
from freepath.catalog import load
from freepath.check.rig import Rig
from freepath.errors import DriverLimitError
from freepath.limits import joined, parts_of
from freepath.runner import Pace, Runner


@pytest.fixture
def limited(device):
    return dataclasses.replace(device.info, loop_limit=65535)


def test_an_interpreter_gets_little_to_do(device):
    slow = dataclasses.replace(device.info, interpreted=True)
    segments = np.arange(7.0 * 100).reshape(100, 7)
    assert limits.rays_of(segments, device.info) is segments
    few = limits.rays_of(segments, slow)
    assert len(np.unique(few[:, 0])) == limits.INTERPRETED_RAYS
    assert (few[0] == segments[0]).all()
    assert (few[-1] == segments[-1]).all()
    assert limits.rays_of(few, slow) is few
    assert [limits.samples_of(samples, slow) for samples in (None, 2, 1000)] == [4, 2, 4]
    assert [limits.samples_of(samples, device.info) for samples in (None, 1000)] == [None, 1000]


def test_units_are_cut_only_where_loops_are_limited(device, limited, monkeypatch):
    assert parts_of(64, device.info) == 1
    assert parts_of(64, limited) == 64
    monkeypatch.setattr(limits, "SAMPLES_OF_A_UNIT", 8)
    assert [parts_of(samples, limited) for samples in (1, 8, 20, 13)] == [1, 1, 4, 13]


def test_what_was_recorded_in_parts_is_joined():
    """Two blocks of three samples of two rays, a sample a unit, and then as they should be."""
    blocks, parts, rays = 2, 3, 2
    recorded = np.arange(blocks * parts * rays * 5, dtype=float).reshape(-1, 1, 5)
    whole = joined(recorded.copy(), rays, parts)
    assert whole.shape == (blocks * rays, parts, 5)
    numbers = recorded.reshape(blocks, parts, rays, 5)
    assert (whole.reshape(blocks, rays, parts, 5)[1, 0, :, 0] == numbers[1, :, 0, 0]).all()
    lookups = np.diff(whole[..., 3], axis=1, prepend=0.0).reshape(blocks, rays, parts)
    assert (lookups == np.moveaxis(numbers[..., 3], 1, 2)).all()
    assert joined(recorded, rays, 1) is recorded


def test_a_launch_that_failed_is_halved():
    pace = Pace(1000)
    assert pace.fit(1000) == 1000
    pace.failed(1000)
    assert pace.fit(1000) == 500
    pace.took(500, 1e-6)
    assert pace.fit(10000) == 500


@pytest.fixture
def flight(device, tmp_path):
    rig = Rig(device, load(), tmp_path)
    return rig.flight(tracker="ratio", estimand="transmittance", medium="homogeneous", lanes=1)


def test_a_launch_that_lost_work_is_taken_again_smaller(flight, monkeypatch):
    whole = flight.run(16, 2)
    read, cut = Runner._read, [True, True]

    def too_few_at_first(self, name, *rest):
        found = read(self, name, *rest)
        return found - 1 if name == "taken" and cut and cut.pop() else found

    monkeypatch.setattr(Runner, "_read", too_few_at_first)
    again = flight.run(16, 2, launches=1)
    assert not cut
    assert again.estimate == whole.estimate
    assert again.counters == whole.counters
    assert again.iterations == whole.iterations


def test_work_that_cannot_be_smaller_is_an_error(flight, monkeypatch):
    read = Runner._read

    def too_few(self, name, *rest):
        return read(self, name, *rest) - (name == "taken")

    monkeypatch.setattr(Runner, "_read", too_few)
    with pytest.raises(DriverLimitError, match="the driver ends loops"):
        flight.run(4)
