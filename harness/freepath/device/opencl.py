"""OpenCL devices: finding them, building on them, launching and timing."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from freepath.compose.source import SCALARS, Source
from freepath.device import cpu_name, drivers
from freepath.device.compilers import compilers_into, told_first
from freepath.errors import BuildError, DeviceError, DriverLimitError, RunError

# pyopencl's cache of binaries is keyed without the environment that steers a driver's compiler, and
# on PoCL it compiles a second time; the drivers keep caches of their own.
os.environ.setdefault("PYOPENCL_NO_CACHE", "1")

import pyopencl as cl  # noqa: E402  (the cache is chosen before the import)

COUNTERS = ("lookups", "crossings", "violations", "steps", "truncated", "nonfinite")
COMPLAINT_LENGTH = 600
LANE_COUNTS = (1, 2, 4, 8, 16)
INTERPRETED = ("-cl-opt-disable", "-DBY_ELEMENT")
"""Oclgrind 21.10 lacks intrinsics that its own optimiser makes of rotations and copies, and takes
one element of two added halves of 16 for uninitialised (docs/devices.md)."""
LLVMPIPE_LOOPS = 65535
"""Mesa 22.3 silently ends all loops of a work-item after so many rounds of them together."""
LLVMPIPE_GROUP = 8
"""llvmpipe follows so many work-items of a group in step; smaller groups leave it idle."""
WorkItems = tuple[int, int]
"""Global and local size of a launch."""


@dataclass(frozen=True)
class DeviceInfo:
    """What a device says of itself."""

    name: str
    """Several alike on one platform are distinguished by a number."""
    platform: str
    driver_version: str
    kind: str
    compute_units: int
    lanes: int
    """The lanes that `lanes: auto` means here."""
    fp64: bool
    timer_resolution_s: float
    logarithm: str
    slow_compiler: bool
    """Whether a kernel that is run once is better built without optimisation."""
    interpreted: bool = False
    """Whether it interprets kernels to check them: then it gets few rays and few samples."""
    loop_limit: int = 0
    """After how many rounds of its loops a driver ends a work-item; 0 where it does not."""

    @property
    def label(self) -> str:
        """One line for messages."""
        return f"{self.name} ({self.platform} {self.driver_version})"

    @property
    def timing_source(self) -> str:
        """`device` where events report the time, `wall` where the driver says that they do not."""
        return "device" if self.timer_resolution_s > 0.0 else "wall"


def _info(device: cl.Device, number: int = 1) -> DeviceInfo:
    is_cpu = bool(device.type & cl.device_type.CPU)
    width = device.native_vector_width_float
    platform = " ".join(device.platform.name.split())
    pocl = "portable computing language" in platform.lower()
    name = " ".join(device.name.split())
    llvmpipe = platform == "rusticl" and name.startswith("llvmpipe")
    return DeviceInfo(
        name=name if number == 1 else f"{name} #{number}",
        platform=platform,
        driver_version=" ".join(device.driver_version.split()),
        kind="CPU" if is_cpu else "GPU" if device.type & cl.device_type.GPU else "other",
        compute_units=device.max_compute_units,
        lanes=max(n for n in LANE_COUNTS if n <= max(width, 1)) if is_cpu else 1,
        fp64=bool(device.double_fp_config),
        timer_resolution_s=device.profiling_timer_resolution * 1e-9,
        # Measured on PoCL: the polynomial runs 16 lanes at up to 1.7 times the built-in's speed.
        logarithm="polynomial" if pocl else "builtin",
        slow_compiler=pocl,
        interpreted=platform == "Oclgrind",
        loop_limit=LLVMPIPE_LOOPS if llvmpipe else 0,
    )


def all_devices() -> list[tuple[cl.Device, DeviceInfo]]:
    """Every device of every platform; a platform may have none and then says so by an error."""
    try:
        platforms = cl.get_platforms()
    except cl.Error:
        return []
    found: list[tuple[cl.Device, DeviceInfo]] = []
    for platform in platforms:
        try:
            devices = platform.get_devices()
        except cl.Error:
            continue
        for device in devices:
            first = _info(device)
            if not drivers.is_in_view(first.platform, first.driver_version):
                continue
            alike = sum(
                other.platform == first.platform and other.name.partition(" #")[0] == first.name
                for _, other in found
            )
            found.append((device, _info(device, alike + 1)))
    return found


def list_devices() -> list[DeviceInfo]:
    """All OpenCL devices of all platforms; empty where there is none."""
    return [info for _, info in all_devices()]


def open_devices(selectors: list[str]) -> list[Device]:
    """Open the devices of this process whose name, platform or driver has a selector in it.

    Without a selector the first. Raises DeviceError where none matches, or one cannot be opened.
    """
    devices = all_devices()
    chosen: dict[int, Device] = {}
    for selector in selectors or ["all"]:
        matching = [i for i, (_, info) in enumerate(devices) if matches(info, selector)]
        if not matching:
            raise DeviceError(f"no OpenCL device of this process matches '{selector}'")
        chosen |= {i: Device(*devices[i]) for i in matching[: None if selectors else 1]}
    return list(chosen.values())


def matches(info: DeviceInfo, selector: str) -> bool:
    """Tell whether a device's name, platform or driver contains a selector; 'all' fits each."""
    wanted = " ".join(selector.lower().split())
    text = f"{info.platform} / {info.name} / {info.driver_version}".lower()
    return wanted == "all" or (bool(wanted) and wanted in text)


@contextmanager
def run_errors(label: str, what: str) -> Iterator[None]:
    """Turn what the driver refuses into a RunError that names the device and what was tried."""
    try:
        yield
    except cl.Error as error:
        raise RunError(f"{label}: {what} failed: {error}") from error


class Device:
    """A device with its context and queue; builds kernels and uploads arrays."""

    def __init__(self, device: cl.Device, info: DeviceInfo):
        self.info = info
        self.compiler_log: Path | None = None
        """Where to keep what compilers print."""
        self.work_group: int | None = None
        """The local size that the user wants."""
        self.state = np.zeros(1)
        """Since when a build or a launch goes on, by the monotonic clock; 0 where none does."""
        self.cl_device = device
        self._complaints = drivers.Complaints()
        cpu_name.mend(info.driver_version, device.int_ptr)
        profiling = cl.command_queue_properties.PROFILING_ENABLE
        try:
            self.context = cl.Context([device])
            self.queue = cl.CommandQueue(self.context, properties=profiling)
        except cl.Error as error:
            raise DeviceError(f"{info.label}: cannot be opened: {error}") from error

    def group_by(self, size: int | None) -> None:
        """Run all kernels in work-groups of this size; DeviceError where the device has none."""
        most = self.cl_device.max_work_group_size
        if size is not None and not 1 <= size <= most:
            expected = f"expected 1 to {most} work-items of a group"
            raise DeviceError(f"--work-group {size}: {self.info.label}: {expected}")
        self.work_group = size

    @property
    def work_items(self) -> WorkItems:
        """Sizes to begin with: the loop is persistent, so a few work-items a core suffice."""
        units = self.info.compute_units
        group, groups = min(64, self.cl_device.max_work_group_size), 16 * units
        if self.info.loop_limit:
            group, groups = LLVMPIPE_GROUP, units
        elif self.info.kind == "CPU":
            group, groups = 1, 4 * units
        wanted = self.work_group or group
        return max(units, groups * group // wanted) * wanted, wanted

    def upload(self, array: np.ndarray | None) -> cl.Buffer:
        """Copy an array to the device; None or an empty one becomes a buffer of one element."""
        if array is None or not array.size:
            array = np.zeros(1)
        array = np.ascontiguousarray(array)
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        with run_errors(self.info.label, f"uploading {array.nbytes} bytes"):
            return cl.Buffer(self.context, flags, hostbuf=array)

    def allocate(self, size: int) -> cl.Buffer:
        """Make a buffer of N bytes."""
        with run_errors(self.info.label, f"allocating {size} bytes"):
            return cl.Buffer(self.context, cl.mem_flags.READ_WRITE, size)

    def read(self, buffer: cl.Buffer, shape: tuple[int, ...], dtype: np.dtype | type) -> np.ndarray:
        """Copy the beginning of a buffer to a new array."""
        array = np.empty(shape, dtype)
        with run_errors(self.info.label, f"reading {array.nbytes} bytes"):
            cl.enqueue_copy(self.queue, array, buffer)
        return array

    def write(self, buffer: cl.Buffer, array: np.ndarray) -> None:
        """Copy an array to the beginning of a buffer."""
        with run_errors(self.info.label, f"writing {array.nbytes} bytes"):
            cl.enqueue_copy(self.queue, buffer, array)

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Let who watches this process know that the driver has it."""
        self.state[0] = time.monotonic()
        try:
            yield
        finally:
            self.state[0] = 0.0

    def build(self, source: Source) -> Program:
        """Compile; raises BuildError with the compiler's log."""
        started = time.perf_counter()
        if self.info.interpreted:
            source = Source(source.text, (*source.options, *INTERPRETED))
        try:
            with warnings.catch_warnings(), compilers_into(self.compiler_log), self.at_work():
                warnings.simplefilter("ignore", cl.CompilerWarning)
                program = cl.Program(self.context, source.text).build(options=list(source.options))
                kernel = cl.Kernel(program, "track")
        except cl.Error as error:
            said = f"{self.info.label} cannot build the kernel:\n{error}"
            raise BuildError(told_first(said, source.text)) from error
        return Program(self, kernel, source, time.perf_counter() - started)

    def check_complaints(self) -> None:
        """Raise RunError where an interpreter has found something wrong since it was last asked."""
        found = self._complaints.new()
        if found:
            text = "; ".join(drivers.report_lines(found))
            raise RunError(f"{self.info.label}: {text[:COMPLAINT_LENGTH]}")


class Program:
    """A built kernel `track` on its device."""

    def __init__(self, device: Device, kernel: cl.Kernel, source: Source, time_build_s: float):
        self.device = device
        self.source = source
        self.time_build_s = time_build_s
        self._kernel = kernel
        self._launched: set[tuple] = set()
        self.work_items = self._fitting(*device.work_items)
        self.calibrated = False

    @contextmanager
    def _first_is_quiet(self, size: tuple) -> Iterator[None]:
        """PoCL compiles at the first launch of a size, and prints then."""
        if size in self._launched:
            yield
            return
        with compilers_into(self.device.compiler_log):
            yield
        self._launched.add(size)

    def _fitting(self, items: int, local: int) -> WorkItems:
        """The device's sizes, in smaller groups where a kernel's registers allow no larger."""
        most = self.told("WORK_GROUP_SIZE") or local
        if self.device.work_group and local > most:
            raise DriverLimitError(f"this kernel runs in work-groups of {most} here, not {local}")
        while local > most:
            local //= 2
        return items // local * local, local

    def told(self, what: str) -> int | None:
        """What CL_KERNEL_WORK_GROUP_INFO says of the kernel; None where a driver says nothing."""
        try:
            asked = getattr(cl.kernel_work_group_info, what)
            return int(self._kernel.get_work_group_info(asked, self.device.cl_device))
        except (cl.Error, AttributeError):
            return None

    @property
    def binary_bytes(self) -> int | None:
        """Size of what the driver compiled; None where it does not say."""
        try:
            return sum(self._kernel.program.binary_sizes) or None
        except (cl.Error, AttributeError):
            return None

    def launch(self, arguments: list, global_size: int, local_size: int) -> float:
        """Run the kernel to its end; returns event seconds (0 where the driver reports none)."""
        size = (global_size,), (local_size,)
        with run_errors(self.device.info.label, "a launch"), self._first_is_quiet(size):
            self._kernel.set_args(*arguments)
            with self.device.at_work():
                event = cl.enqueue_nd_range_kernel(self.device.queue, self._kernel, *size)
                event.wait()
        self.device.check_complaints()
        if self.device.info.timing_source == "wall":
            return 0.0  # rusticl 22.3 has no timer and may report a nanosecond
        try:
            return max(0, event.profile.end - event.profile.start) * 1e-9
        except cl.Error:
            return 0.0


def scalar_type(arithmetic: str) -> np.dtype:
    """The numpy type of the kernel's SCALAR."""
    return np.dtype(np.float64 if SCALARS[arithmetic] == "double" else np.float32)
