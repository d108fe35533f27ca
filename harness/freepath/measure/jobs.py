"""Cases on devices: what is composed for each, so that it is known before anything is built."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from freepath.cases.plan import Case
from freepath.compose import source
from freepath.compose.catalog import Catalog, Tracker
from freepath.compose.source import Source, Structure
from freepath.device import environment, limits
from freepath.device.opencl import Device
from freepath.errors import UsageError
from freepath.measure.binding import Scene, structure_of
from freepath.measure.rounds import Bench
from freepath.measure.row import base_row, composed_for
from freepath.results.folder import key_of
from freepath.scene import build_medium, majorants


def scenes_of(cases: Iterable[Case], folders: Iterable[Path]) -> dict[Case, Scene]:
    """The scene of each case; all cases of a config fly the same rays, and a medium is made once.

    Raises VolumeError for volumes, rays and images that cannot be used.
    """
    scenes: dict[str, Scene] = {}
    found = {}
    for case in cases:
        key = str(case.medium.as_dict())
        # what cannot be used is reported before anything runs
        _check_memory(case)
        if key not in scenes:
            scenes[key] = Scene.of(case, build_medium(case.medium, folders), folders)
        limits.check_units(case, scenes[key].medium, float(scenes[key].bounds((1, 1, 1))[1].max()))
        scenes[key].sky(case)
        scenes[key].as_stored(case)
        found[case] = scenes[key]
    return found


def _check_memory(case: Case) -> None:
    """Refuse a majorant whose cells do not fit into what memory is left."""
    if case.majorant is None:
        return
    cells = math.prod(majorants.cells_of(case.majorant))
    needed = majorants.bytes_of(case.majorant, case.params.get("control"))
    left = environment.memory_left()
    if needed > left:
        sizes = f"{needed / 2**30:.3g} GiB, {left / 2**30:.3g} are left"
        raise UsageError(f"{case.name}: its majorant of {cells} cells takes {sizes}")


def inputs_of(scenes: dict[Case, Scene]) -> list[str]:
    """What is used of each file: of a volume its grid, of an image its channels."""
    used: dict[str, None] = {}
    for case, scene in scenes.items():
        for one in (scene.medium, scene.sky(case)):
            used |= {one.told: None} if one is not None and one.told else {}
    # names of files, grids and channels may hold what moves a terminal's cursor
    return ["".join(c if c.isprintable() else "?" for c in one) for one in used]


@dataclass(eq=False)
class Job:
    """A case on a device: its row so far, its sources, and its bench once it is built."""

    case: Case
    device: Device
    scene: Scene
    """With the rays that the device gets."""
    row: dict[str, Any]
    tracker: Tracker
    unbiased: bool
    """Whether its tracker is, and that of its shadow rays."""
    structure: Structure | None = None
    timed: Source | None = None
    """None where the case is skipped."""
    counting: Source | None = None
    bench: Bench | None = None

    @classmethod
    def of(cls, case: Case, device: Device, scene: Scene, known: Catalog, run_id: str) -> Job:
        """Compose the sources of a case, or say in its row why it is skipped."""
        scene = scene.for_device(device.info)
        row = base_row(case, device.info, run_id)
        row["effects"] = composed_for(case, scene.medium.kernel)
        row["rays"] = len(scene.segments)
        row["config_sha256"] = source.combined_hash(case.config_sha256, scene.fingerprint_of(case))
        names = [case.tracker, *([case.shadow.kind] if case.shadow else [])]
        unbiased = all(known.trackers[name].unbiased for name in names)
        job = cls(case, device, scene, row, known.trackers[case.tracker], unbiased)
        if case.arithmetic == "double" and not device.info.fp64:
            row["reason"] = row["reason"] or "the device has no double precision"
        row["reason"] = row["reason"] or job._control_reason()
        if not row["reason"]:
            job._compose(known)
        return job

    def _compose(self, known: Catalog) -> None:
        medium = self.scene.medium
        self.structure, counting = (
            structure_of(self.case, known, medium, self.device, count=count)
            for count in (False, True)
        )
        along = self.structure.paths.names if self.structure.paths else ()
        self.row["effects"] = composed_for(self.case, medium.kernel, along)
        self.timed, self.counting = source.compose(self.structure), source.compose(counting)
        if self.device.info.slow_compiler:
            self.counting = self.counting.unoptimised()
        self.row["source_sha256"] = self.timed.sha256

    def _control_reason(self) -> str:
        """Why a tracker cannot take its control; '' where it can."""
        case, tracker = self.case, self.tracker
        if "control" not in tracker.needs or tracker.bounding is not True:
            return ""
        excess = self.scene.as_stored(case).majorant(case, controlled=True).control_excess
        if excess <= majorants.EXCESS:
            return ""
        share = f"{case.params['share']:g} x {case.params['control']}"
        return f"{case.tracker} allows no control above the extinction, and {share} is somewhere"

    @property
    def key(self) -> tuple[str, ...]:
        """What a row must agree in to stand for it."""
        return key_of(self.row)

    @property
    def place(self) -> tuple[str, ...]:
        """Device and medium: jobs of one place are measured in turns."""
        return self.device.info.label, str(self.case.medium.as_dict())
