"""Runs a built kernel over rays and samples, in launches that stay short."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from freepath.device import COUNTERS, Device, Program, scalar_type
from freepath.source import Source
from freepath.stats import Moments, merge_blocks

STEP_CAP = 1 << 20
"""Steps after which a path is cut off and counted as truncated."""
SAMPLES_PER_UNIT = (1 << 31) // STEP_CAP - 1
"""So that the 32-bit counters of a unit cannot overflow even if every path reaches the cap."""


@dataclass(frozen=True)
class KernelData:
    """What a kernel reads, on the device: shared by all cases that fly the same rays."""

    rays: cl.Buffer
    ray_count: int
    medium: cl.Buffer

    @classmethod
    def upload(cls, device: Device, segments: np.ndarray, medium_data, arithmetic: str) -> KernelData:
        """Upload segments (rays, 7) and the medium's array (or None)."""
        data = np.zeros(0, np.float32) if medium_data is None else medium_data
        rays = device.upload(segments.astype(scalar_type(arithmetic)))
        return cls(rays, len(segments), device.upload(data))


@dataclass(frozen=True)
class Round:
    """The same number of samples of every ray: what they gave and what they took."""

    samples: int
    """Samples of all rays together."""
    estimate: float
    variance: float
    """Of one sample, averaged over rays."""
    counters: dict[str, int]
    iterations: int
    time_device_s: float
    time_wall_s: float
    timing_source: str
    moments: Moments | None
    """Per ray; let go of once it is merged with those of other rounds."""
    recorded: np.ndarray | None = None
    """(units, samples, 4): t, weight, escaped, lookups so far in the unit; only of recording kernels."""

    @property
    def time_s(self) -> float:
        """Device time, or wall time where the driver reports none."""
        return self.time_device_s if self.timing_source == "device" else self.time_wall_s


class Runner:
    """A program bound to its rays, medium, majorant and numbers."""

    def __init__(
        self,
        program: Program,
        data: KernelData,
        numbers: list[float],
        majorant_data: np.ndarray | None,
        arithmetic: str,
        lanes: int,
        seed: int,
    ):
        self.program = program
        self.lanes = lanes
        self.rays = data.ray_count
        self._data = data
        self._device = program.device
        self._scalar = scalar_type(arithmetic)
        self._seed = np.uint64(seed)
        self._numbers = self._device.upload(np.array(numbers, self._scalar))
        majorant = np.zeros(0, np.float32) if majorant_data is None else majorant_data
        self._majorant = self._device.upload(majorant)
        self._buffers: dict[tuple, cl.Buffer] = {}

    @property
    def source(self) -> Source:
        """The source of the program."""
        return self.program.source

    def run(
        self,
        first_sample: int,
        samples: int,
        blocks: int = 1,
        *,
        launches: int = 1,
        record: bool = False,
        work_items: tuple[int, int] | None = None,
    ) -> Round:
        """Take `blocks` blocks of `samples` samples of every ray, cut into `launches` launches.

        Sample numbers start at first_sample; each is the same however it is blocked and cut.
        """
        units = self.rays * blocks
        work_items = work_items or self._device.work_items
        outputs = self._outputs(units, work_items[0], samples if record else 0)
        time_device, iterations, started = 0.0, 0, time.perf_counter()
        for first, end in _cuts(units, launches):
            time_device += self._launch(first_sample, samples, first, end, outputs, work_items)
            iterations += int(self._read("iterations", outputs, (work_items[0],), np.uint64).sum())
        time_wall = time.perf_counter() - started
        moments = self._read("moments", outputs, (blocks, self.rays, 2), self._scalar)
        counters = self._read("counters", outputs, (units, len(COUNTERS)), np.uint32)
        recorded = None
        if record:
            recorded = self._read("recorded", outputs, (units, samples, 4), self._scalar)
        merged = merge_blocks(moments[..., 0], moments[..., 1], samples)
        return Round(
            samples=units * samples,
            estimate=float(merged.mean.mean()),
            variance=float(merged.variance.mean()),
            counters=dict(zip(COUNTERS, counters.sum(0, dtype=np.uint64).tolist(), strict=True)),
            iterations=iterations,
            time_device_s=time_device,
            time_wall_s=time_wall,
            timing_source="device" if time_device > 0 else "wall",
            moments=merged,
            recorded=recorded,
        )

    def _launch(self, first_sample, samples, first, end, outputs, work_items) -> float:
        queue = self._device.queue
        cl.enqueue_copy(queue, outputs["taken"], np.array([first], np.uint32))
        arguments = [
            self._seed,
            np.uint64(first_sample),
            np.uint32(samples),
            np.uint32(end),
            np.uint32(self.rays),
            np.uint32(STEP_CAP),
            self._numbers,
            self._data.rays,
            self._data.medium,
            self._majorant,
            *(outputs[name] for name in ("taken", "moments", "counters", "iterations", "recorded")),
        ]
        return self.program.launch(arguments, *work_items)

    def _outputs(self, units: int, work_items: int, recorded: int) -> dict[str, cl.Buffer]:
        scalar = self._scalar.itemsize
        sizes = {
            "taken": 4,
            "moments": units * 2 * scalar,
            "counters": units * 4 * len(COUNTERS),
            "iterations": work_items * 8,
            "recorded": max(units * recorded * 4 * scalar, 8),
        }
        return {name: self._buffer(name, size) for name, size in sizes.items()}

    def _buffer(self, name: str, size: int) -> cl.Buffer:
        """Keep output buffers between rounds: allocating them anew costs more than filling them."""
        if (name, size) not in self._buffers:
            self._buffers = {key: value for key, value in self._buffers.items() if key[0] != name}
            buffer = cl.Buffer(self._device.context, cl.mem_flags.READ_WRITE, size)
            self._buffers[name, size] = buffer
        return self._buffers[name, size]

    def _read(self, name: str, outputs: dict, shape: tuple, dtype) -> np.ndarray:
        array = np.empty(shape, dtype)
        cl.enqueue_copy(self._device.queue, array, outputs[name])
        return array


def _cuts(units: int, launches: int) -> list[tuple[int, int]]:
    edges = np.linspace(0, units, min(launches, units) + 1).astype(int).tolist()
    return list(zip(edges[:-1], edges[1:], strict=True))
