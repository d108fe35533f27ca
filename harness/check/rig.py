"""Flies rays through media as a run does: the same config, plan, source, device and runner."""

from __future__ import annotations

import json
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from freepath import binding, config, plan, source
from freepath.binding import Scene
from freepath.catalog import Catalog, Tracker
from freepath.check.media import CHORDS, MAJORANTS, MEDIA
from freepath.check.verdict import NotApplicable
from freepath.device import Device, Program, scalar_type
from freepath.plan import Case
from freepath.runner import KernelData, Round, Runner
from freepath.scene import Medium, Sky, build_medium, path_reference, reference
from freepath.scene import segments as inside
from freepath.source import Source

SEED = 20240229


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
class Samples:
    """Single samples, each array of the shape (rays, samples), and the round they came from."""

    t: np.ndarray
    weight: np.ndarray
    escaped: np.ndarray
    lookups: np.ndarray
    score: np.ndarray
    """What each contributes to the mean."""
    round: Round
    weights: np.ndarray
    scores: np.ndarray
    """Of each channel, (channels, rays, samples); those above are of the first."""


@dataclass(frozen=True)
class Flight:
    """A case that is built and ready to run."""

    case: Case
    tracker: Tracker
    medium: Medium
    segments: np.ndarray
    """As the kernel reads them: in its precision, so that rounding of input is no error of it."""
    stored: Medium
    """The medium as the kernel reads it: with its voxels rounded to what is stored of them."""
    runner: Runner
    recording: bool
    """Whether the kernel writes every sample: then every run must give it the room."""
    sky: Sky | None = None

    @property
    def rounding(self) -> float:
        """The unit roundoff of the kernel's arithmetic."""
        return float(np.finfo(scalar_type(self.case.arithmetic)).eps) / 2

    def reference(self) -> np.ndarray:
        """The exact value of each ray."""
        if self.case.light is not None:
            return path_reference(self.case, self.medium, self.segments, self.sky)
        return reference(self.case.estimand, self.medium, self.segments)

    def as_stored(self) -> Flight:
        """The same, held to the medium as it is stored."""
        return replace(self, medium=self.stored)

    def run(self, samples: int, blocks: int = 1, **options: Any) -> Round:
        """Take samples of every ray, from number 0 on unless `first_sample` says otherwise."""
        first = options.pop("first_sample", 0)
        return self.runner.run(first, samples, blocks, record=self.recording, **options)

    def record(self, samples: int, blocks: int = 1, **options: Any) -> Samples:
        """Take samples and keep each."""
        one = self.run(samples, blocks, **options)
        width = one.recorded.shape[-1]
        recorded = one.recorded.reshape(blocks, -1, samples, width).astype(np.float64)
        values = np.moveaxis(recorded, (3, 1), (0, 1))
        # lookups are a running count of each unit
        values[3] = np.diff(values[3], axis=2, prepend=0.0)
        values = values.reshape(width, -1, blocks * samples)
        weights, scores = values[[1, *range(5, width, 2)]], values[4::2]
        t, weight, escaped, lookups, score = values[:5]
        return Samples(t, weight, escaped > 0, lookups, score, one, weights, scores)


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

    def with_trackers(self, catalog: Catalog) -> Rig:
        """The same rig for another catalog; it shares what is built, as those below do."""
        rig = copy(self)
        rig.catalog = catalog
        return rig

    def with_seed(self, seed: int) -> Rig:
        """The same rig with other random numbers."""
        rig = copy(self)
        rig.seed = seed
        return rig

    def with_arithmetic(self, name: str) -> Rig:
        """The same rig with another arithmetic of flights that do not name theirs."""
        rig = copy(self)
        rig.arithmetic = name
        return rig

    def with_storage(self, name: str) -> Rig:
        """The same rig with another storage of voxels in flights that do not name theirs."""
        rig = copy(self)
        rig.storage = name
        return rig

    def with_change(self, change: Change) -> Rig:
        """The same rig with a defect in each source that has a place for it."""
        rig = copy(self)
        rig._changes = (*self._changes, change)
        return rig

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
        # JSON is YAML
        seed = self.seed if seed is None else seed
        text = json.dumps({"name": "check", "seed": seed, "rays": rays, "matrix": axes})
        path = self.folder / "case.yaml"
        path.write_text(text)
        loaded = config.load(path, self.catalog.parameter_models())
        (case,) = plan.expand(loaded, self.catalog)
        if case.skip_reason:
            raise NotApplicable(case.skip_reason)
        return case

    def flight(
        self,
        *,
        lines: tuple[np.ndarray, np.ndarray] | None = None,
        count: bool = True,
        record: bool = True,
        **axes: Any,
    ) -> Flight:
        """Build a case. `lines` are origins and directions of its rays, not random chords."""
        case = self.case(**axes)
        key = str(case.medium.as_dict())
        if key not in self._media:
            self._media[key] = build_medium(case.medium)
        medium = self._media[key]
        scene = Scene(medium, inside(*lines, medium)) if lines else Scene.of(case, medium, [])
        structure = binding.structure_of(
            case, self.catalog, medium, self.device, count=count, record=record
        )
        text = source.compose(structure)
        stored = scene.as_stored(case)
        voxels = stored.medium.data
        data = KernelData.upload(self.device, scene.segments, voxels, case.arithmetic)
        runner = binding.runner_of(case, structure, stored, self.program(text), data)
        read = scene.segments.astype(scalar_type(case.arithmetic)).astype(np.float64)
        tracker = self.catalog.trackers[case.tracker]
        sky = scene.sky(case)
        return Flight(case, tracker, medium, read, stored.medium, runner, record, sky)

    def program(self, text: Source) -> Program:
        """Build a source, each only once."""
        for change in self._changes:
            text = Source(change.apply(text.text), text.options)
        if text.sha256 not in self._programs:
            self._programs[text.sha256] = self.device.build(text)
        return self._programs[text.sha256]


def _named(known: dict[str, Any], name: Any) -> Any:
    return known.get(name, name) if isinstance(name, str) else name
