"""Flies rays through media as a run does: the same config, plan, source, device and runner."""

from __future__ import annotations

import json
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from freepath import config
from freepath.cases import plan
from freepath.cases.plan import Case
from freepath.checks.media import CHORDS, MAJORANTS, MEDIA
from freepath.checks.samples import Samples
from freepath.checks.verdict import NotApplicable
from freepath.compose import source
from freepath.compose.catalog import Catalog, Tracker
from freepath.compose.source import Source
from freepath.device.opencl import Device, Program, scalar_type
from freepath.measure import binding
from freepath.measure.binding import Scene
from freepath.measure.runner import KernelData, Round, Runner
from freepath.scene import Medium, build_medium
from freepath.scene import segments as inside

Lines = tuple[np.ndarray, np.ndarray]
SEED = 20240229
MOST_SCENES = 256
"""Rays in their medium that are kept: more than the checks that share their kernels have."""


@dataclass(frozen=True)
class Change:
    """A defect to plant: a piece of the composed source, and what to put in its place."""

    old: str
    new: str
    planted: list[str] = field(default_factory=list, compare=False)
    """Where it was: a defect that has no place any more must not count as one that was missed."""

    def apply(self, text: str) -> str:
        """Replace the one place, in sources that have it; LookupError where there are several."""
        places = text.count(self.old)
        if places > 1:
            raise LookupError(f"{places} places for {self.old!r}")
        if places:
            self.planted.append(self.old)
        return text.replace(self.old, self.new)


@dataclass(frozen=True)
class Flight:
    """A case that is built and ready to run."""

    case: Case
    tracker: Tracker
    scene: Scene
    """With the rays as the kernel reads them, so that rounding of input is no error of it."""
    stored: Medium
    """The medium as the kernel reads it: with its voxels rounded to what is stored of them."""
    runner: Runner
    recording: bool
    """Whether the kernel writes every sample: then every run must give it the room."""

    @property
    def medium(self) -> Medium:
        return self.scene.medium

    @property
    def segments(self) -> np.ndarray:
        """In the precision of the kernel, (rays, 7)."""
        return self.scene.segments

    @property
    def depth(self) -> np.ndarray:
        return self.scene.depth

    @property
    def rounding(self) -> float:
        """The unit roundoff of the kernel's arithmetic."""
        return float(np.finfo(scalar_type(self.case.arithmetic)).eps) / 2

    def reference(self) -> np.ndarray:
        return self.scene.reference(self.case)

    def as_stored(self) -> Flight:
        """The same, held to the medium as it is stored."""
        return replace(self, scene=Scene(self.stored, self.segments))

    def run(self, samples: int, blocks: int = 1, **options: Any) -> Round:
        """Take samples of every ray, from number 0 on unless `first_sample` says otherwise."""
        first = options.pop("first_sample", 0)
        return self.runner.run(first, samples, blocks, record=self.recording, **options)

    def record(self, samples: int, blocks: int = 1, **options: Any) -> Samples:
        return Samples(self.run(samples, blocks, **options), blocks, samples)


class Rig:
    """Makes flights on one device; what is built once is not built again in a session."""

    def __init__(self, device: Device, catalog: Catalog, folder: Path, seed: int = SEED):
        self.device = device
        self.catalog = catalog
        self.folder = folder
        self.seed = seed
        self.arithmetic = "strict"
        self.storage = "float"
        self._changes: tuple[Change, ...] = ()
        self._programs: dict[str, Program] = {}
        self._media: dict[str, Medium] = {}
        self._cases: dict[str, Case] = {}
        self._kept: dict[Any, tuple[Scene, Scene]] = {}

    # the same rig with something else, which shares what is built

    def _with(self, **others: Any) -> Rig:
        rig = copy(self)
        vars(rig).update(others)
        return rig

    def with_trackers(self, catalog: Catalog) -> Rig:
        return self._with(catalog=catalog, _cases={})

    def with_seed(self, seed: int) -> Rig:
        return self._with(seed=seed)

    def without_scenes(self) -> Rig:
        """With nothing kept of scenes: for what changes how they are made."""
        return self._with(_kept={})

    def with_arithmetic(self, name: str) -> Rig:
        """Of flights that do not name theirs."""
        return self._with(arithmetic=name)

    def with_storage(self, name: str) -> Rig:
        """Of voxels in flights that do not name theirs."""
        return self._with(storage=name)

    def with_change(self, change: Change) -> Rig:
        """With a defect in each source that has a place for it."""
        return self._with(_changes=(*self._changes, change))

    def volume(self, voxels: np.ndarray, **keys: Any) -> dict[str, Any]:
        """A medium of a config from voxels [z, y, x], by way of a file as a user gives them."""
        path = self.folder / f"{source.combined_hash(np.ascontiguousarray(voxels).tobytes())}.npy"
        if not path.exists():
            np.save(path, voxels.astype(np.float32))
        return {"volume": {"file": str(path), **keys}}

    def case(self, *, rays: dict = CHORDS, seed: int | None = None, **axes: Any) -> Case:
        """The one case of a config; media and majorants may be given by their names here."""
        axes = {"arithmetic": self.arithmetic, "storage": self.storage} | axes
        axes["medium"] = _named(MEDIA, axes["medium"])
        axes["majorant"] = _named(MAJORANTS, axes.get("majorant", "global"))
        if self.device.info.loop_limit:
            # llvmpipe takes minutes to compile wider vectors than its own
            axes["lanes"] = self.device.info.lanes
        seed = self.seed if seed is None else seed
        # repeats differ by their seed alone
        document = {"name": "check", "rays": rays, "matrix": axes}
        key = json.dumps(document)
        if key not in self._cases:
            self._cases[key] = self._parsed(document | {"seed": seed})
        case = replace(self._cases[key], seed=seed)
        if case.skip_reason:
            raise NotApplicable(case.skip_reason)
        return case

    def _parsed(self, document: dict[str, Any]) -> Case:
        path = self.folder / "case.yaml"
        # JSON is YAML
        path.write_text(json.dumps(document))
        loaded = config.load(path, self.catalog.parameter_models())
        (case,) = plan.expand(loaded, self.catalog)
        return case

    def flight(
        self,
        *,
        lines: Lines | None = None,
        turned: np.ndarray | None = None,
        count: bool = True,
        record: bool = True,
        **axes: Any,
    ) -> Flight:
        """Build a case. `lines` are origins and directions of its rays, not random chords.

        `turned` (3, 3) are the sides of a unit cube of the medium in the world, as columns: for
        voxels that are sheared and rotated as those of an OpenVDB file may be.
        """
        case = self.case(**axes)
        scene, read = self._scenes(case, lines, turned)
        medium = scene.medium
        structure = binding.structure_of(
            case, self.catalog, medium, self.device, count=count, record=record
        )
        text = source.compose(structure)
        stored = scene.as_stored(case)
        voxels = stored.medium.data
        data = KernelData.upload(self.device, scene.segments, voxels, case.arithmetic)
        runner = binding.runner_of(case, structure, stored, self.program(text), data)
        tracker = self.catalog.trackers[case.tracker]
        return Flight(case, tracker, read, stored.medium, runner, record)

    def _scenes(
        self, case: Case, lines: Lines | None, turned: np.ndarray | None
    ) -> tuple[Scene, Scene]:
        """The scene of a case, and the same with its rays rounded as the kernel reads them."""
        kind = f"{case.medium.as_dict()} {turned}"
        if kind not in self._media:
            self._media[kind] = made = build_medium(case.medium)
            if turned is not None:
                made.to_medium = made.to_medium @ np.pad(np.linalg.inv(turned), (0, 1))
        medium = self._media[kind]
        rays = str(case.rays.as_dict())
        # no other rays are drawn: those are the same in every repeat, and so are their references
        drawn = case.seed if case.rays.kind == "chords" else None
        given = tuple(array.tobytes() for array in lines) if lines else (rays, drawn)

        def make() -> tuple[Scene, Scene]:
            scene = Scene(medium, inside(*lines, medium)) if lines else Scene.of(case, medium, [])
            read = scene.segments.astype(scalar_type(case.arithmetic)).astype(np.float64)
            return scene, Scene(medium, read)

        return self._recent((kind, given, case.arithmetic), make)

    def _recent(self, key: Any, make: Callable[[], Any]) -> Any:
        """What was made for a key, unless much else has been asked for since."""
        made = self._kept.pop(key) if key in self._kept else make()
        self._kept[key] = made
        if len(self._kept) > MOST_SCENES:
            self._kept.pop(next(iter(self._kept)))
        return made

    def program(self, text: Source) -> Program:
        for change in self._changes:
            text = Source(change.apply(text.text), text.options)
        if text.sha256 not in self._programs:
            self._programs[text.sha256] = self.device.build(text)
        return self._programs[text.sha256]


def _named(known: dict[str, Any], name: Any) -> Any:
    return known.get(name, name) if isinstance(name, str) else name
