"""Runs a built kernel over rays and samples, in launches that stay short."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyopencl as cl

from freepath.device import limits
from freepath.device.opencl import COUNTERS, Device, Program, WorkItems, scalar_type
from freepath.measure.stats import Moments, merge_blocks, squares_of

STEP_CAP = 1 << 20
"""Steps after which a path is cut off and counted as truncated."""
SAMPLES_PER_UNIT = (1 << 31) // STEP_CAP - 1
"""So that the 32-bit counters of a unit cannot overflow even if every path reaches the cap."""
MOST_SAMPLES_OF_A_LAUNCH = 1 << 62
"""No limit, until a driver shows one."""
LAUNCH_S = 0.25
"""Device time below which a launch should stay. What is longer is cut into launches of half of it,
as some rays take longer than others."""


Outputs = dict[str, cl.Buffer]


@dataclass(frozen=True)
class KernelData:
    """What kernels read and write, on the device: shared by all cases that fly the same rays."""

    device: Device
    rays: cl.Buffer
    ray_count: int
    medium: cl.Buffer
    _kept: dict[Any, cl.Buffer] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def upload(
        cls, device: Device, segments: np.ndarray, medium_data: np.ndarray | None, arithmetic: str
    ) -> KernelData:
        """Upload segments (rays, 7) and the medium's array (or None)."""
        rays = device.upload(segments.astype(scalar_type(arithmetic)))
        return cls(device, rays, len(segments), device.upload(medium_data))

    def keep(self, key: Any, array: np.ndarray | None) -> cl.Buffer:
        """Upload an array (or None) unless one was before under this key."""
        if key not in self._kept:
            self._kept[key] = self.device.upload(array)
        return self._kept[key]

    def output(self, name: str, size: int) -> cl.Buffer:
        """A buffer of so many bytes or more; kept, as allocating it costs more than filling it."""
        if name not in self._kept or self._kept[name].size < size:
            self._kept.pop(name, None)
            self._kept[name] = self.device.allocate(size)
        return self._kept[name]


@dataclass(frozen=True)
class Round:
    """The same number of samples of every ray: what they gave and what they took."""

    samples: int
    """Samples of all rays together."""
    estimate: float
    variance: float | None
    """Of one sample, averaged over rays; None where a ray has but one sample."""
    counters: dict[str, int]
    iterations: int
    time_device_s: float
    time_wall_s: float
    timing_source: str
    moments: Moments | None
    """Per ray; let go of once it is merged with those of other rounds."""
    means: np.ndarray | None = None
    """(blocks, rays) or (blocks, rays, channels): the mean of each block of samples; let go of like
    the moments."""
    squares: np.ndarray | None = None
    """(blocks, rays): squared deviations of each block of samples; let go of like the moments."""
    recorded: np.ndarray | None = None
    """(units, samples, 3 + 2 channels): t, weight, escaped, lookups so far in the unit, score; then
    weight and score of each further channel."""

    @property
    def time_s(self) -> float:
        """Device time, or wall time where the driver reports none."""
        return self.time_device_s if self.timing_source == "device" else self.time_wall_s

    @property
    def time_per_sample_s(self) -> float:
        """`time_s` of one sample."""
        return self.time_s / self.samples


class Pace:
    """How many samples fit into a launch, judged by how long the ones before took."""

    def __init__(self, first: int):
        self._most = first
        self._limit = MOST_SAMPLES_OF_A_LAUNCH
        self._seconds_per_sample = 0.0

    def fit(self, left: int) -> int:
        """Samples for the next launch, of so many that are left."""
        pace, left = self._seconds_per_sample, min(left, self._limit)
        if left <= self._most and left * pace <= LAUNCH_S:
            return left
        return min(left, self._most, int(LAUNCH_S / 2 / pace) if pace else left)

    def took(self, samples: int, seconds: float) -> None:
        """Learn from a launch; the next may be four times as large, however quick this one was."""
        self._most = max(self._most, 4 * samples)
        self._seconds_per_sample = seconds / samples

    def failed(self, samples: int) -> None:
        """Learn from a launch that did not come to its end: half of it is the most from now on."""
        self._limit = samples // 2


@dataclass
class Runner:
    """A program bound to its rays, medium, majorant and numbers."""

    program: Program
    data: KernelData
    numbers: cl.Buffer
    majorant: cl.Buffer
    arithmetic: str
    lanes: int
    seed: int
    channels: int = 1
    _pace: Pace = field(init=False, repr=False)

    def __post_init__(self):
        self._pace = Pace(self.lanes_in_all)

    @property
    def rays(self) -> int:
        """How many rays each sample number stands for."""
        return self.data.ray_count

    @property
    def _device(self) -> Device:
        return self.program.device

    @property
    def _scalar(self) -> np.dtype:
        return scalar_type(self.arithmetic)

    @property
    def _tallied(self) -> int:
        """Scores of a sample that are tallied: of several channels their mean too."""
        return 1 if self.channels == 1 else self.channels + 1

    @property
    def _recorded(self) -> int:
        return 3 + 2 * self.channels

    @property
    def lanes_in_all(self) -> int:
        """Paths that the device follows at once."""
        return self.program.work_items[0] * self.lanes

    def run(
        self,
        first_sample: int,
        samples: int,
        blocks: int = 1,
        *,
        launches: int | None = None,
        record: bool = False,
        work_items: WorkItems | None = None,
    ) -> Round:
        """Take `blocks` blocks of `samples` samples of every ray.

        In launches that stay short, unless it is said how many. Sample numbers start at
        first_sample; each sample is the same however it is blocked and cut.
        """
        parts = limits.parts_of(samples, self._device.info)
        samples, blocks = samples // parts, blocks * parts
        units = self.rays * blocks
        work_items = work_items or self.program.work_items
        lanes = work_items[0] * self.lanes
        outputs = self._outputs(units, work_items[0], samples if record else 0)
        time_device, iterations, first, started = 0.0, 0, 0, time.perf_counter()
        while first < units:
            end = first + self._units_of_a_launch(units - first, units, samples, launches)
            numbers = range(first_sample, first_sample + samples)
            seconds = self._launch(numbers, first, end, outputs, work_items)
            taken = int(self._read("taken", outputs, (1,), np.uint32)[0])
            if not limits.check(taken, end, lanes, end - first, self._device.info):
                self._pace.failed((end - first) * samples)
                launches = None
                continue
            time_device += seconds
            iterations += int(self._read("iterations", outputs, (work_items[0],), np.uint64).sum())
            first = end
        time_wall = time.perf_counter() - started
        means, m2 = self._moments(outputs, blocks)
        moments = merge_blocks(means, m2, samples)
        single = slice(None) if self.channels == 1 else slice(None, -1)
        squares = squares_of(means[..., single], m2[..., single], samples)
        moments = moments.flat if self.channels == 1 else moments.of_channels
        means = means[..., 0] if self.channels == 1 else means[..., :-1]
        counters = self._read("counters", outputs, (units, len(COUNTERS)), np.uint32)
        recorded = None
        if record:
            recorded = self._read(
                "recorded", outputs, (units, samples, self._recorded), self._scalar
            )
            recorded = limits.joined(recorded, self.rays, parts)
        return Round(
            samples=units * samples,
            estimate=float(moments.mean.mean()),
            variance=float(moments.variance.mean()) if moments.count > 1 else None,
            counters=dict(zip(COUNTERS, counters.sum(0, dtype=np.uint64).tolist(), strict=True)),
            iterations=iterations,
            time_device_s=time_device,
            time_wall_s=time_wall,
            timing_source="device" if time_device > 0 else "wall",
            moments=moments,
            means=means,
            squares=squares,
            recorded=recorded,
        )

    def _units_of_a_launch(self, left: int, units: int, samples: int, launches: int | None) -> int:
        if launches:
            return min(left, -(-units // launches))
        # fewer units than lanes would take as long
        return min(left, max(self.lanes_in_all, self._pace.fit(left * samples) // samples))

    def _launch(
        self, samples: range, first: int, end: int, outputs: Outputs, work_items: WorkItems
    ) -> float:
        """Run units first to end; `samples` are the numbers of the first block. Event seconds."""
        started = time.perf_counter()
        self._device.write(outputs["taken"], np.array([first], np.uint32))
        arguments = [
            np.uint64(self.seed),
            np.uint64(samples.start),
            np.uint32(len(samples)),
            np.uint32(end),
            np.uint32(self.rays),
            np.uint32(STEP_CAP),
            self.numbers,
            self.data.rays,
            self.data.medium,
            self.majorant,
            *outputs.values(),
        ]
        seconds = self.program.launch(arguments, *work_items)
        self._pace.took((end - first) * len(samples), seconds or time.perf_counter() - started)
        return seconds

    def _outputs(self, units: int, work_items: int, recorded: int) -> Outputs:
        """The kernel's last arguments, in its order."""
        scalar = self._scalar.itemsize
        sizes = {
            "taken": 4,
            "moments": units * 3 * self._tallied * scalar,
            "counters": units * 4 * len(COUNTERS),
            "iterations": work_items * 8,
            "recorded": max(units * recorded * self._recorded * scalar, 8),
        }
        return {name: self.data.output(name, size) for name, size in sizes.items()}

    def _moments(self, outputs: Outputs, blocks: int) -> tuple[np.ndarray, np.ndarray]:
        """Mean and m2 (blocks, rays, tallied); a unit's mean comes in two parts, less excess."""
        shape = (blocks, self.rays, self._tallied, 3)
        parts = self._read("moments", outputs, shape, self._scalar)
        mean, excess, m2 = np.moveaxis(parts.astype(np.float64), -1, 0)
        return mean - excess, m2

    def _read(
        self, name: str, outputs: Outputs, shape: tuple, dtype: np.dtype | type
    ) -> np.ndarray:
        return self._device.read(outputs[name], shape, dtype)
