"""OpenCL devices: finding them, building on them, launching and timing."""

from __future__ import annotations

import os
import time
import warnings
from dataclasses import dataclass

import numpy as np

from freepath.errors import BuildError, DeviceError, RunError
from freepath.source import SCALARS, Source

# pyopencl's cache of binaries is keyed without the environment that steers a driver's compiler, and on
# PoCL it compiles a second time; the drivers keep caches of their own.
os.environ.setdefault("PYOPENCL_NO_CACHE", "1")

import pyopencl as cl  # noqa: E402  (the cache is chosen before the import)

COUNTERS = ("lookups", "crossings", "violations", "steps", "truncated", "nonfinite")
LANE_COUNTS = (1, 2, 4, 8, 16)


@dataclass(frozen=True)
class DeviceInfo:
    """What a device says of itself."""

    name: str
    platform: str
    driver_version: str
    kind: str
    compute_units: int
    lanes: int
    """The lanes that `lanes: auto` means here."""
    fp64: bool
    timer_resolution_s: float
    logarithm: str

    @property
    def label(self) -> str:
        """One line for tables."""
        return f"{self.name} ({self.platform} {self.driver_version})"


def _info(device: cl.Device) -> DeviceInfo:
    is_cpu = bool(device.type & cl.device_type.CPU)
    width = device.native_vector_width_float
    pocl = "portable computing language" in device.platform.name.lower()
    return DeviceInfo(
        name=device.name.strip(),
        platform=device.platform.name.strip(),
        driver_version=device.driver_version.strip(),
        kind="CPU" if is_cpu else "GPU" if device.type & cl.device_type.GPU else "other",
        compute_units=device.max_compute_units,
        lanes=max(n for n in LANE_COUNTS if n <= max(width, 1)) if is_cpu else 1,
        fp64=bool(device.double_fp_config),
        timer_resolution_s=device.profiling_timer_resolution * 1e-9,
        # Measured on PoCL: the polynomial runs 16 lanes at up to 1.7 times the built-in's speed.
        logarithm="polynomial" if pocl else "builtin",
    )


def _all_devices() -> list[cl.Device]:
    try:
        platforms = cl.get_platforms()
    except cl.Error:
        return []
    found = []
    for platform in platforms:
        try:
            found += platform.get_devices()
        except cl.Error:
            continue  # a platform without devices says so by an error
    return found


def list_devices() -> list[DeviceInfo]:
    """All OpenCL devices of all platforms; empty where there is none."""
    return [_info(device) for device in _all_devices()]


def device_records() -> list[dict]:
    """What `freepath devices` lists."""
    return [
        {
            "device": info.name,
            "platform": info.platform,
            "driver": info.driver_version,
            "kind": info.kind,
            "compute units": info.compute_units,
            "lanes": info.lanes,
            "double": info.fp64,
            "timer resolution [ns]": round(info.timer_resolution_s * 1e9),
        }
        for info in list_devices()
    ]


def open_devices(selectors: list[str]) -> list[Device]:
    """Open the devices whose name, platform or driver contains a selector; without one, the first.

    Raises DeviceError where there is no device or a selector matches none.
    """
    devices = _all_devices()
    if not devices:
        raise DeviceError(
            "no OpenCL device found; `pip install freepath[pocl]` brings one that runs on the CPU"
        )
    if not selectors:
        return [Device(devices[0])]
    chosen: list[cl.Device] = []
    for selector in selectors:
        matching = [d for d in devices if selector == "all" or _matches(d, selector)]
        if not matching:
            names = "\n".join(f"  {_info(device).label}" for device in devices)
            raise DeviceError(f"no OpenCL device matches {selector!r}; there are\n{names}")
        chosen += [device for device in matching if device not in chosen]
    return [Device(device) for device in chosen]


def _matches(device: cl.Device, selector: str) -> bool:
    info = _info(device)
    return selector.lower() in f"{info.platform} / {info.name} / {info.driver_version}".lower()


class Device:
    """A device with its context and queue; builds kernels and uploads arrays."""

    def __init__(self, device: cl.Device):
        self.info = _info(device)
        self._device = device
        self.context = cl.Context([device])
        profiling = cl.command_queue_properties.PROFILING_ENABLE
        self.queue = cl.CommandQueue(self.context, properties=profiling)

    @property
    def work_items(self) -> tuple[int, int]:
        """Global and local size: the loop is persistent, so a few work-items a core suffice."""
        if self.info.kind == "CPU":
            return 4 * self.info.compute_units, 1
        local = min(64, self._device.max_work_group_size)
        return self.info.compute_units * local * 16, local

    def upload(self, array: np.ndarray) -> cl.Buffer:
        """Copy an array to the device; an empty one becomes a buffer of one element."""
        array = np.ascontiguousarray(array if array.size else np.zeros(1, array.dtype))
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self.context, flags, hostbuf=array)

    def build(self, source: Source) -> Program:
        """Compile; raises BuildError with the compiler's log."""
        started = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", cl.CompilerWarning)
                program = cl.Program(self.context, source.text).build(options=list(source.options))
        except cl.Error as error:
            raise BuildError(f"{self.info.label} cannot build the kernel:\n{error}") from error
        return Program(self, program, source, time.perf_counter() - started)


class Program:
    """A built kernel `track` on its device."""

    def __init__(self, device: Device, program: cl.Program, source: Source, time_build_s: float):
        self.device = device
        self.source = source
        self.time_build_s = time_build_s
        self._kernel = cl.Kernel(program, "track")

    def launch(self, arguments: list, global_size: int, local_size: int) -> float:
        """Run the kernel to its end; returns event seconds (0 where the driver reports none)."""
        try:
            self._kernel.set_args(*arguments)
            size = (global_size,), (local_size,)
            event = cl.enqueue_nd_range_kernel(self.device.queue, self._kernel, *size)
            event.wait()
            return (event.profile.end - event.profile.start) * 1e-9
        except cl.Error as error:
            raise RunError(f"{self.device.info.label}: a launch failed: {error}") from error


def scalar_type(arithmetic: str) -> np.dtype:
    """The numpy type of the kernel's SCALAR."""
    return np.dtype(np.float64 if SCALARS[arithmetic] == "double" else np.float32)
