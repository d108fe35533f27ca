"""From a case in its scene to the source that it is composed of, and to a runner."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from freepath.cases.plan import Case
from freepath.compose import light_paths as effects
from freepath.compose import source
from freepath.compose.catalog import ANY, Catalog, Tracker
from freepath.compose.kernel_files import TrackerFile
from freepath.compose.source import Structure
from freepath.config.path_axes import weights_grow
from freepath.device import limits
from freepath.device.opencl import Device, DeviceInfo, Program, scalar_type
from freepath.measure.runner import KernelData, Runner
from freepath.scene import (
    Medium,
    Sky,
    majorants,
    make_rays,
    path_reference,
    read_sky,
    reference,
    segments,
)
from freepath.scene.majorants import Majorant


@dataclass(frozen=True)
class Scene:
    """A medium with the rays that fly through it; what is dear to derive from them is kept."""

    medium: Medium
    segments: np.ndarray
    """(rays, 7), as scene.segments gives them."""
    search_path: tuple[str | Path, ...] = ()
    """Where images of lights are looked for first."""
    _kept: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(cls, case: Case, medium: Medium, search_path: Iterable[str | Path]) -> Scene:
        """Make the rays of a case in its medium."""
        origins, directions = make_rays(case.rays, medium, case.seed, search_path)
        return cls(medium, segments(origins, directions, medium), tuple(search_path))

    def _keep(self, key: Any, make: Callable[[], Any]) -> Any:
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]

    def for_device(self, info: DeviceInfo) -> Scene:
        """The same, with but a few rays, evenly chosen, where a device interprets kernels."""
        few = limits.rays_of(self.segments, info)
        if few is self.segments:
            return self
        return self._keep("few", lambda: Scene(self.medium, few, self.search_path))

    def as_stored(self, case: Case) -> Scene:
        """The same as the kernel of a case reads it: with the voxels in the case's storage.

        All that must bound or fit what the kernel reads comes from it; references are this one's.
        Raises VolumeError for voxels that cannot be stored so.
        """
        if case.storage == "float":
            return self

        def stored() -> Scene:
            return Scene(self.medium.stored(case.storage), self.segments, self.search_path)

        return self._keep(("stored", case.storage), stored)

    def sky(self, case: Case) -> Sky | None:
        """The image that lights a case, in the medium's channels; None where it has none.

        Raises VolumeError for a file that cannot be used.
        """
        if not hasattr(case.light, "file"):
            return None
        count = len(self.medium.channels)
        return self._keep(case.light, lambda: read_sky(case.light, count, self.search_path))

    def fingerprint_of(self, case: Case) -> str:
        """Identifies the medium, the rays and the image that lights a case."""
        sky = self.sky(case)
        return source.combined_hash(self.fingerprint, sky.fingerprint) if sky else self.fingerprint

    @property
    def fingerprint(self) -> str:
        """Identifies the medium and the rays."""
        return self._keep(
            "fingerprint",
            lambda: source.combined_hash(self.medium.fingerprint, self.segments.tobytes()),
        )

    @property
    def depth(self) -> np.ndarray:
        """The optical depth of each ray."""
        return self._keep("depth", lambda: self.medium.optical_depth(self.segments))

    def reference(self, case: Case) -> np.ndarray | None:
        """The exact value of a case for each ray, (rays,) or (rays, channels); None without one."""
        if case.light is None:
            key = case.estimand
            return self._keep(key, lambda: reference(key, self.medium, self.segments))
        key = (case.estimand, case.light, case.scatterings)
        return self._keep(
            key, lambda: path_reference(case, self.medium, self.segments, self.sky(case))
        )

    def bounds(self, cells: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
        """The tightest minorant and majorant of each cell, [nz, ny, nx]."""
        return self._keep(cells, lambda: self.medium.bounds(cells))

    def majorant(self, case: Case, *, controlled: bool) -> Majorant:
        """The majorant of a case, and the control that a controlled tracker splits off.

        Without numbers for a tracker that uses none.
        """
        if case.majorant is None:
            return Majorant({})
        bounds = self.bounds(majorants.cells_of(case.majorant))
        strongest = float(self.medium.channels.max())
        if strongest != 1.0:
            bounds = bounds[0] * strongest, bounds[1] * strongest
        control = case.params if controlled else None
        return majorants.build(case.majorant, self.medium, bounds, case.tightness, control)

    def largest_score(self, case: Case) -> float:
        """What no score exceeds while weights stay below 1, or below the number of channels.

        inf where a point light may be as near as one likes, or where weights grow at scatterings.
        """
        if case.estimand == "mean_extinction":
            return float(self.bounds((1, 1, 1))[1].max())
        if weights_grow(case):
            return math.inf
        if case.estimand == "radiance":
            return self._brightest(case) * len(self.medium.channels)
        longest = 1.0 if case.estimand == "transmittance" else float(self.segments[:, 6].max())
        return longest * len(self.medium.channels)

    def _brightest(self, case: Case) -> float:
        """What a path collects at most, where it is absorbed and where it leaves."""
        if any(getattr(case.light, "intensity", ())):
            return math.inf
        sky = self.sky(case)
        around = float(sky.table.max()) if sky else max(getattr(case.light, "radiance", (0.0,)))
        return around + max(case.medium.emission)


def structure_of(
    case: Case,
    catalog: Catalog,
    medium: Medium,
    device: Device,
    *,
    count: bool,
    record: bool = False,
) -> Structure:
    """Decide what the source of a case consists of."""
    tracker = _composed(catalog.trackers[case.tracker], case.params)
    chromatic, paths = catalog.trackers[case.tracker].channels == ANY, None
    if case.light is not None:
        light = case.shadow
        shadow = _composed(catalog.trackers[light.kind], light.parameters()) if light else None
        paths = effects.of_scene(case, medium, tracker, shadow, chromatic=chromatic)
    needs = tracker.needs | (paths.shadow.needs if paths and paths.shadow else frozenset())
    majorant = case.majorant.kind if case.majorant else None
    return Structure(
        tracker=tracker,
        needs=needs,
        estimand=case.estimand,
        medium=medium.kernel,
        medium_numbers=tuple(medium.numbers),
        majorant=majorant,
        majorant_numbers=majorants.numbers_of(case.majorant, needs),
        lanes=device.info.lanes if case.lanes == "auto" else int(case.lanes),
        arithmetic=case.arithmetic,
        storage=case.storage,
        channels=paths.channels if paths else len(medium.channels),
        chromatic=paths.chromatic if paths else chromatic,
        paths=paths,
        logarithm=device.info.logarithm,
        count=count,
        record=record,
    )


def _composed(tracker: Tracker, given: Mapping[str, Any]) -> TrackerFile:
    """A tracker with its parameters, which are numbers that a kernel reads, or defines."""
    read = {name: p.choices for name, p in tracker.parameters.items() if not p.host}
    numbers = tuple(name for name, choices in read.items() if choices is None)
    chosen = tuple((n, str(given[n]), tuple(map(str, c))) for n, c in read.items() if c is not None)
    same = {name: getattr(tracker, name) for name in ("name", "code", "needs", "uses", "aims")}
    return TrackerFile(**same, numbers=numbers, choices=chosen, state=tuple(tracker.state.items()))


def runner_of(
    case: Case, structure: Structure, scene: Scene, program: Program, data: KernelData
) -> Runner:
    """Bind a built program to the numbers and the majorant of a case.

    `scene` and `data` are as the case stores them.
    """
    controlled = "control" in structure.needs
    medium, majorant = scene.medium, scene.majorant(case, controlled=controlled)
    numbers = source.numbers_of(
        structure,
        medium.extent.tolist(),
        medium.numbers,
        majorant.numbers,
        np.broadcast_to(medium.channels, structure.channels).tolist(),
        dict(case.params),
        case.shadow.parameters() if case.shadow else {},
    )
    # cases that share a majorant and a control share their buffer
    control = tuple(sorted(case.params.items())) if controlled else None
    key: tuple[Any, ...] = (case.majorant, case.tightness, control)
    in_buffer = majorant.data
    if structure.paths and "environment_image" in structure.paths:
        key = (*key, case.light, structure.channels)
        in_buffer = _behind(scene.sky(case), structure.channels, majorant.data)
    buffer = data.keep(key, in_buffer)
    uploaded = program.device.upload(np.array(numbers, scalar_type(case.arithmetic)))
    fixed = case.arithmetic, structure.lanes, case.seed, structure.channels
    return Runner(program, data, uploaded, buffer, *fixed)


def _behind(sky: Sky, channels: int, majorant: np.ndarray | None) -> np.ndarray:
    """A majorant's array behind the table of a sky, of which each channel has its own."""
    table = np.broadcast_to(sky.table, (channels, *sky.table.shape[1:])).reshape(-1)
    return table if majorant is None else np.concatenate([table, majorant.reshape(-1)])
