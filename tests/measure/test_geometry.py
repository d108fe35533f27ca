"""Launch geometry: what is tried, that the fastest is taken, and that no sample depends on it."""

import dataclasses

import numpy as np
import pytest

from freepath import api, cli
from freepath.compose.source import Source
from freepath.device.opencl import cl, open_devices
from freepath.errors import DeviceError, DriverLimitError, RunError
from freepath.measure import geometry
from freepath.measure.rounds import Bench
from freepath.measure.stopping import Rule
from freepath.results.folder import read_rows

NOTHING = "__kernel void track(__global uint *out) { out[get_global_id(0)] = 7; }"
RULE = Rule(error=0.01, time_noise=0.02, at_most_s=0.1)
CONFIG = """\
name: small
rays: {orthographic: {resolution: [8, 8]}}
matrix: {medium: {homogeneous: {sigma_t: 1}}, tracker: [delta, march], lanes: 1}
stop: {samples: 200, rounds: 2}
"""


@pytest.fixture
def another(device, selector):
    """The device, opened anew, so that it may be told other things."""
    return open_devices([selector])[0]


@pytest.fixture
def flight(rig):
    return rig.flight(tracker="delta", medium="trilinear", majorant="grid", lanes=1, record=False)


def program_that_says(device, **said):
    """A real program whose driver says other things of its kernel."""
    program = device.build(Source(NOTHING, ()))
    program.told = said.get
    return program


def gpu(device, units=10):
    device.info = dataclasses.replace(device.info, kind="GPU", compute_units=units)
    return device


@pytest.mark.parametrize(
    ("multiple", "most", "groups"),
    [
        (32, 1024, {32, 64, 128, 256}),
        (64, 256, {64, 128, 256}),
        (64, 96, {64}),
        (8, 128, {32, 64, 128}),
        (48, 1024, {48, 96, 192}),
        (None, None, {32}),
    ],
)
def test_what_is_tried(another, multiple, most, groups):
    said = {"PREFERRED_WORK_GROUP_SIZE_MULTIPLE": multiple, "WORK_GROUP_SIZE": most}
    found = geometry.candidates(program_that_says(gpu(another), **said))
    assert {group for _, group in found} == groups
    assert len(set(found)) == len(found) >= 2
    for items, group in found:
        assert items % group == 0
        assert 10 * 128 < items <= 10 * 2048


def test_a_kernel_that_takes_small_groups_only_gets_these(another):
    found = geometry.candidates(program_that_says(gpu(another), WORK_GROUP_SIZE=16))
    assert {group <= 64 for _, group in found} == {True}


def test_only_devices_that_are_no_cpu_are_tried_out(another):
    assert not geometry.is_open(another.info)
    assert geometry.is_open(gpu(another).info)
    assert not geometry.is_open(dataclasses.replace(another.info, interpreted=True))
    assert not geometry.is_open(dataclasses.replace(another.info, loop_limit=65535))


def test_sizes_to_begin_with(another):
    units = another.info.compute_units
    assert another.work_items == (4 * units, 1)
    another.group_by(32)
    assert another.work_items == (32 * units, 32)
    assert gpu(another).work_items == (10 * 1024, 32)
    another.group_by(None)
    assert another.work_items == (10 * 1024, 64)


def test_a_group_that_the_device_has_not(another):
    for size in (0, -1, 1 << 20):
        with pytest.raises(DeviceError, match=f"--work-group {size}: .*expected 1 to"):
            another.group_by(size)


def test_a_group_that_a_kernel_has_not(another, monkeypatch):
    monkeypatch.setattr("freepath.device.opencl.Program.told", lambda self, what: 24)
    another.group_by(32)
    with pytest.raises(DriverLimitError, match="work-groups of 24 here, not 32"):
        another.build(Source(NOTHING, ()))
    another.group_by(None)
    assert gpu(another).build(Source(NOTHING, ())).work_items == (10 * 1024 // 16 * 16, 16)


def test_what_the_driver_says(device):
    program = device.build(Source(NOTHING, ()))
    most = program.told("WORK_GROUP_SIZE")
    assert 1 <= most <= device.cl_device.max_work_group_size
    assert program.told("PREFERRED_WORK_GROUP_SIZE_MULTIPLE") >= 1
    assert program.told("PRIVATE_MEM_SIZE") is not None
    assert program.told("NO_SUCH_THING") is None


def test_a_driver_that_says_nothing(device):
    program = device.build(Source(NOTHING, ()))

    class Silent:
        def get_work_group_info(self, *_):
            raise cl.LogicError("clGetKernelWorkGroupInfo failed: INVALID_VALUE")

    program._kernel = Silent()
    assert program.told("WORK_GROUP_SIZE") is None


def trials(flight, monkeypatch, slow=(), refuses=()):
    """Choose on a real device; what some geometries take is multiplied, others are refused."""
    runner, tried = flight.runner, []
    program = runner.program
    before, launch = program.work_items, program.launch

    def watched(arguments, items, group):
        if (items, group) in refuses:
            raise RunError("a launch failed: OUT_OF_RESOURCES")
        tried.append((items, group))
        return launch(arguments, items, group) * (1 if (items, group) not in slow else 100)

    with monkeypatch.context() as patched:
        for name, value in {"launch": watched, "calibrated": False, "work_items": before}.items():
            patched.setattr(program, name, value)
        geometry.choose(Bench(runner, runner, RULE))
        return program.work_items, tried


def test_the_fastest_is_taken(flight, monkeypatch):
    """On the CPU, by force, where every geometry but one is made slow."""
    found = geometry.candidates(flight.runner.program)
    assert len(found) > 3
    for best in (found[0], found[-1], found[len(found) // 2]):
        slow = [one for one in found if one != best]
        chosen, tried = trials(flight, monkeypatch, slow)
        assert chosen == best
        assert set(found) <= set(tried)
        assert tried.count(best) == 2


def test_what_is_refused_is_not_taken(flight, monkeypatch):
    found = geometry.candidates(flight.runner.program)
    chosen, _ = trials(flight, monkeypatch, refuses=found[1:])
    assert chosen == found[0]
    with pytest.raises(RunError, match="OUT_OF_RESOURCES"):
        trials(flight, monkeypatch, refuses=found)


def test_it_is_chosen_once(flight, monkeypatch):
    program = flight.runner.program
    monkeypatch.setattr(program, "calibrated", True)
    monkeypatch.setattr(program, "launch", None)
    geometry.choose(Bench(flight.runner, flight.runner, RULE))


def test_estimates_are_equal_bit_by_bit(rig, flight):
    found = geometry.candidates(flight.runner.program)
    most = flight.runner.program.told("WORK_GROUP_SIZE") or 1
    further = [(3 * group, group) for group in (1, 8, 32, 64, 256) if group <= most]
    assert len(further) > 2
    one = flight.run(64, 16)
    for items in [*found, *further]:
        other = flight.run(64, 16, work_items=items)
        for name in ("mean", "m2"):
            same = np.array_equal(getattr(one.moments, name), getattr(other.moments, name))
            assert same, f"{name} at {items}"
        assert (one.estimate, one.variance) == (other.estimate, other.variance)
        assert one.counters == other.counters


def test_a_run_in_groups(work, selector, capsys):
    (work / "small.yaml").write_text(CONFIG)
    arguments = ["run", "small.yaml", "-d", selector, "-o", "out", "--work-group"]
    assert cli.main([*arguments, "32"]) == 0, capsys.readouterr().err
    rows = read_rows(work / "out" / "summary.csv")
    assert {row["work_group"] for row in rows} == {"32"}
    assert all(int(row["work_items"]) % 32 == 0 and row["private_bytes"] for row in rows)
    # rows of other groups do not stand for these
    before = {row["run_id"] for row in rows}
    assert cli.main([*arguments, "16", "--resume"]) == 0
    rows = read_rows(work / "out" / "summary.csv")
    assert {row["work_group"] for row in rows} == {"16"}
    assert before.isdisjoint(row["run_id"] for row in rows)
    assert cli.main([*arguments, "1000000", "--resume"]) == 2
    assert "--work-group 1000000: " in capsys.readouterr().err


def test_a_run_where_it_is_chosen(work, another, monkeypatch):
    """A CPU that is taken for a GPU: the row has one of the geometries that were tried."""
    (work / "small.yaml").write_text(CONFIG)
    monkeypatch.setattr(geometry, "is_open", lambda info: True)
    sweep = api.sweep("small.yaml", "out")
    sweep.devices = [another]
    sweep.run()
    rows = read_rows(work / "out" / "summary.csv")
    assert rows
    assert all(int(row["work_group"]) >= 32 for row in rows)
    assert all(int(row["work_items"]) % int(row["work_group"]) == 0 for row in rows)
