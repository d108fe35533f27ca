import dataclasses
import re
import subprocess
import sys
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest

from freepath import cli
from freepath.checks.rig import Rig
from freepath.compose.catalog import load
from freepath.device import environment, limits
from freepath.device.limits import joined, parts_of
from freepath.errors import DriverLimitError
from freepath.measure.runner import Pace, Runner
from freepath.results.folder import read_rows
from freepath.scene import majorants
from freepath.scene.media.formulas import Homogeneous


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


@pytest.fixture
def scaled(work, selector, capsys):
    """Run a grid of 4 x 4 x 4 voxels of some size, and of the same optical depth; its rows."""
    np.save("v.npy", np.random.default_rng(1).random((4, 4, 4), np.float32) + 0.1)

    def run(size, estimand):
        trackers = "[delta, ratio, regular]" if estimand == "transmittance" else "[delta, regular]"
        text = f"""\
name: scaled
rays: {{orthographic: {{resolution: 4, direction: [0.3, 0.01, 1]}}}}
matrix:
  estimand: {estimand}
  medium: {{volume: {{file: v.npy, sigma_t: {0.2 / size!r}, voxel_size: {size!r}}}}}
  majorant: [global, {{grid: {{resolution: 2}}}}]
  tracker: {trackers}
stop: {{samples: 400}}
"""
        (work / "scaled.yaml").write_text(text)
        output = f"{estimand}-{size!r}"
        code = cli.main(["run", "scaled.yaml", "-d", selector, "-o", output])
        return code, capsys.readouterr().err, Path(output)

    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("estimand", "sizes", "beyond"),
    [
        ("transmittance", (2e-30, 1.4e21), (1e-31, 1.5e21, 1e28, 1e30, 1e37)),
        ("free_path", (1.5e-16, 1.4e14), (1.4e-16, 1.5e14, 1e28)),
    ],
)
def test_the_range_that_float32_holds(scaled, estimand, sizes, beyond):
    """At both ends of it the same samples have the same scores as with voxels of size 1."""
    found = {}
    for size in (1.0, *sizes):
        code, _, output = scaled(size, estimand)
        assert code == 0
        unit = 1.0 if estimand == "transmittance" else size
        for row in read_rows(output / "summary.csv"):
            assert row["status"] == "ok"
            key = row["tracker"], row["majorant"].split("-")[0]
            numbers = float(row["estimate"]) / unit, float(row["variance"]) / unit**2
            assert numbers == pytest.approx(found.setdefault(key, numbers), rel=2e-3, abs=1e-9)
    assert len(found) >= 3
    for size in beyond:
        code, said, output = scaled(size, estimand)
        assert code == 2
        assert "which float32 holds: choose another unit of length" in said
        assert not output.exists()


def test_a_majorant_that_does_not_fit_is_refused(work, selector):
    """In a process that may take 4 GiB: a grid one cell thick is nine times as large in memory."""
    (work / "x.yaml").write_text(
        "name: x\nmatrix: {medium: {homogeneous: {sigma_t: 1}}, tracker: delta,\n"
        "  majorant: {grid: {resolution: [1, 1, 134217728]}}}\n"
    )
    limited = (
        "import resource, sys; from freepath import cli; "
        "resource.setrlimit(resource.RLIMIT_AS, (2**32, 2**32)); "
        f"sys.exit(cli.main(['run', 'x.yaml', '-d', {selector!r}, '-o', 'out']))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", limited], check=False, capture_output=True, text=True
    )
    assert ended.returncode == 2, ended.stderr
    assert re.search(
        r"its majorant of 134217728 cells takes 22 GiB, [0-3]\S* are left", ended.stderr
    )
    assert not Path("out").exists()


@pytest.mark.parametrize("kind", ["grid", "octree"])
@pytest.mark.parametrize("control", [None, "middle", "mean", "placement"])
@pytest.mark.parametrize("shape", [(2, 3, 2**10), (32, 64, 32)])
def test_what_a_majorant_takes_is_told_beforehand(kind, control, shape):
    """At least what is seen while it is made and its copy, and not more than three times that."""
    given = 64 if kind == "octree" else shape
    model = SimpleNamespace(kind=kind, resolution=given, slack=1.1)
    medium = Homogeneous(1.0, (1.0, 1.0, 1.0))
    cells = majorants.cells_of(model)[::-1]
    bounds = np.ones(cells), np.full(cells, 2.0)
    asked = {"control": control, "share": 1.0} if control else None
    asked = {"placement": "second_moment"} if control == "placement" else asked
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    made = majorants.build(model, medium, bounds, 2.0, asked)
    seen = tracemalloc.get_traced_memory()[1] - before + bounds[0].nbytes * 2 + made.data.nbytes
    tracemalloc.stop()
    assert seen <= majorants.bytes_of(model, control) <= 3 * seen


def test_the_memory_that_is_left():
    assert 2**20 < environment.memory_left() <= psutil.virtual_memory().total
