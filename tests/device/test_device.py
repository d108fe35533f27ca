import os
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from freepath.compose.source import Source
from freepath.device import drivers
from freepath.device import opencl as devices
from freepath.device.compilers import compilers_into, first_error
from freepath.device.opencl import DeviceInfo, cl, list_devices, matches, open_devices, scalar_type
from freepath.errors import BuildError, DeviceError, RunError

INFO = DeviceInfo(
    "pthread-Intel(R) Xeon(R)",
    "Portable Computing Language",
    "3.0-rc2",
    "CPU",
    2,
    16,
    True,
    1e-9,
    "polynomial",
    True,
)
NOTHING = "__kernel void track(__global uint *out) { out[get_global_id(0)] = 7; }"


@pytest.mark.parametrize(
    "selector",
    [
        "xeon",
        "XEON",
        "portable",
        "3.0",
        "all",
        " all ",
        "Language / pthread",
        "Portable  Computing",
    ],
)
def test_selectors_that_match(selector):
    assert matches(INFO, selector)


@pytest.mark.parametrize("selector", ["", "  ", "nvidia", "3.1", "allx"])
def test_selectors_that_do_not(selector):
    assert not matches(INFO, selector)


def made_up(name="thing", platform="maker", **given):
    return SimpleNamespace(
        **{
            "name": f" {name}  ",
            "platform": SimpleNamespace(name=platform),
            "driver_version": "1.0",
            "type": cl.device_type.CPU,
            "native_vector_width_float": 8,
            "max_compute_units": 2,
            "double_fp_config": 0,
            "profiling_timer_resolution": 80,
        }
        | given
    )


def offer(monkeypatch, *platforms):
    """Let OpenCL offer platforms: each a list of devices, or an error."""
    monkeypatch.setattr(drivers, "current", lambda: None)

    def devices_of(offered):
        if isinstance(offered, Exception):
            raise offered
        return offered

    found = [SimpleNamespace(get_devices=lambda p=p: devices_of(p)) for p in platforms]
    monkeypatch.setattr(devices.cl, "get_platforms", lambda: found)


def no_devices():
    return cl.LogicError("clGetDeviceIDs failed: DEVICE_NOT_FOUND")


def test_lanes_are_the_width_of_a_cpu_and_1_elsewhere(monkeypatch):
    gpu = {"type": cl.device_type.GPU, "native_vector_width_float": 4}
    widths = [made_up(native_vector_width_float=width) for width in (0, 1, 4, 12, 16, 64)]
    offer(monkeypatch, [*widths, made_up("gpu", **gpu)])
    assert [info.lanes for info in list_devices()] == [1, 1, 4, 8, 16, 16, 1]
    assert [info.kind for info in list_devices()][-2:] == ["CPU", "GPU"]
    assert not list_devices()[0].fp64


def test_devices_that_are_alike_are_told_apart(monkeypatch):
    offer(monkeypatch, [made_up(), made_up()], [made_up(platform="other")], [made_up()])
    assert [info.name for info in list_devices()] == ["thing", "thing #2", "thing", "thing #3"]


def test_a_platform_without_devices_is_no_error(monkeypatch):
    offer(monkeypatch, no_devices(), [made_up()], [])
    assert [info.name for info in list_devices()] == ["thing"]


def test_no_device_at_all_is_an_empty_list(monkeypatch):
    def none():
        raise cl.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")

    offer(monkeypatch, no_devices())
    assert list_devices() == []
    monkeypatch.setattr(devices.cl, "get_platforms", none)
    assert list_devices() == []
    with pytest.raises(DeviceError, match="no OpenCL device of this process matches 'x'"):
        open_devices(["x"])


def test_a_device_that_two_selectors_match_is_opened_once(device, selector):
    assert len(open_devices([selector, selector])) == 1
    assert len(open_devices(["all", selector])) == len(list_devices())
    assert open_devices([])[0].info == list_devices()[0]


def test_arrays_come_back(device):
    array = np.arange(6, dtype=np.float32).reshape(2, 3)
    buffer = device.upload(array)
    assert (device.read(buffer, (2, 3), np.float32) == array).all()
    assert (device.read(buffer, (2,), np.float32) == [0, 1]).all()
    device.upload(None)
    device.upload(array[:0])


def test_a_kernel_runs_and_is_timed(device):
    program = device.build(Source(NOTHING, ()))
    out = device.allocate(16)
    device.write(out, np.zeros(4, np.uint32))
    seconds = program.launch([out], 4, 1)
    assert (device.read(out, (4,), np.uint32) == 7).all()
    assert 0 <= seconds < 1
    assert program.time_build_s > 0


def test_a_kernel_that_does_not_compile(device):
    broken = '#line 41 "trackers/mine.cl"\n__kernel void track(void) { nonsense; }'
    with pytest.raises(BuildError, match=r"trackers/mine\.cl:41"):
        device.build(Source(broken, ()))


def test_an_error_comes_first_with_its_line(device):
    broken = '#line 1 "trackers/mine.cl"\n\n__kernel void track(void) { int b = nonsense; }'
    with pytest.raises(BuildError) as caught:
        device.build(Source(broken, ()))
    error, line, caret, *_ = str(caught.value).splitlines()
    assert error.startswith("trackers/mine.cl:2:"), error
    assert "error: " in error
    assert line.strip() == "__kernel void track(void) { int b = nonsense; }"
    assert line[caret.index("^") :].startswith("nonsense")
    assert first_error(caught.value) == error


WARNS = "__kernel void track(__global uint *out) { int a = 4294967299; out[0] = a; }"


def test_what_compilers_print_goes_into_a_log(device, capfd, tmp_path, monkeypatch):
    print("not a compiler's", file=sys.stderr)
    monkeypatch.setattr(device, "compiler_log", tmp_path / "log")
    with compilers_into(tmp_path / "log"):
        os.write(2, b"1 warning generated.\n")
    assert not (tmp_path / "log").exists(), "nothing worth keeping"
    with compilers_into(tmp_path / "log"):
        os.write(2, b"LLVM ERROR: out of luck\n")
    assert (tmp_path / "log").read_text() == "LLVM ERROR: out of luck\n"
    program = device.build(Source(f"{WARNS} // {tmp_path}", ()))
    program.launch([device.allocate(16)], 1, 1)
    assert capfd.readouterr().err == "not a compiler's\n"


def test_a_source_without_the_kernel(device):
    with pytest.raises(BuildError):
        device.build(Source("__kernel void other(void) {}", ()))


def test_what_the_driver_refuses_is_no_traceback(device):
    program = device.build(Source(NOTHING, ()))
    with pytest.raises(RunError, match="a launch failed"):
        program.launch([device.allocate(16)], 4, 3)
    with pytest.raises(RunError, match="reading 400 bytes failed"):
        device.read(device.allocate(16), (100,), np.float32)
    with pytest.raises(RunError, match="allocating 1125899906842624 bytes failed"):
        device.allocate(1 << 50)


def test_scalars():
    assert scalar_type("strict") == scalar_type("fast") == np.float32
    assert scalar_type("double") == np.float64
