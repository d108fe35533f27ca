"""Runs the cases of a plan on devices, medium by medium, and writes their rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freepath import majorants, source
from freepath.catalog import Catalog
from freepath.device import Device, Program
from freepath.errors import BuildError, RunError
from freepath.kernel_files import split_front_matter
from freepath.measure import Bench, Rule, interleave
from freepath.plan import Case
from freepath.results import ResultFolder, key_of
from freepath.rows import base_row, effects_of, measured_row, round_rows
from freepath.runner import KernelData, Round, Runner
from freepath.scene import Medium, make_rays, reference, segments
from freepath.source import Source, Structure


@dataclass
class Job:
    """A case on a device: its row so far, its sources, and its bench once it is built."""

    case: Case
    row: dict[str, Any]
    structure: Structure | None = None
    sources: dict[bool, Source] = field(default_factory=dict)
    """By whether they count."""
    bench: Bench | None = None


@dataclass(frozen=True)
class Scene:
    """A medium with the rays that fly through it; segments as scene.segments gives them."""

    medium: Medium
    segments: np.ndarray

    @classmethod
    def of(cls, case: Case, medium: Medium, search_path: list) -> Scene:
        """Make the rays of a case in its medium."""
        origins, directions = make_rays(case.rays, medium, case.seed, search_path)
        return cls(medium, segments(origins, directions, medium))


def structure_of(
    case: Case, catalog: Catalog, medium: Medium, device: Device, *, count: bool, record: bool = False
) -> Structure:
    """Decide what the source of a case consists of."""
    tracker = catalog.trackers[case.tracker]
    _, code = split_front_matter(tracker.source, f"{tracker.name}.cl")
    parameters = [(name, p) for name, p in tracker.parameters.items() if not p.host]
    choices = [(name, p.choices) for name, p in parameters if p.choices is not None]
    return Structure(
        tracker=tracker.name,
        tracker_code=code,
        needs=tracker.needs,
        tracker_numbers=tuple(name for name, p in parameters if p.choices is None),
        tracker_state=tuple(tracker.state.items()),
        choices=tuple((n, str(case.params[n]), tuple(map(str, given))) for n, given in choices),
        estimand=case.estimand,
        medium=medium.kernel,
        medium_numbers=tuple(medium.numbers),
        majorant=case.majorant.kind if case.majorant else None,
        majorant_numbers=majorants.numbers_of(case.majorant, tracker.needs),
        lanes=device.info.lanes if case.lanes == "auto" else int(case.lanes),
        arithmetic=case.arithmetic,
        logarithm=device.info.logarithm,
        count=count,
        record=record,
    )


def runner_of(
    case: Case, structure: Structure, scene: Scene, program: Program, data: KernelData
) -> Runner:
    """Bind a built program to the numbers and the majorant of a case."""
    majorant = majorants.Majorant({})
    if case.majorant:
        control = case.params if "control" in structure.needs else None
        majorant = majorants.build(case.majorant, scene.medium, case.tightness, control)
    medium = scene.medium
    numbers = source.numbers_of(
        structure, medium.extent.tolist(), medium.numbers, majorant.numbers, dict(case.params)
    )
    arguments = (majorant.data, case.arithmetic, structure.lanes, case.seed)
    return Runner(program, data, numbers, *arguments)


class Sweep:
    """Cases on one device, writing into one folder."""

    def __init__(
        self,
        device: Device,
        catalog: Catalog,
        folder: ResultFolder,
        run_id: str,
        on_done: Callable[[dict[str, Any]], None],
        on_progress: Callable[[float], None],
    ):
        self.device = device
        self.folder = folder
        self.time_build_s = 0.0
        self._catalog = catalog
        self._run_id = run_id
        self._on_done = on_done
        self._on_progress = on_progress
        self._programs: dict[str, Program] = {}

    def plan(self, case: Case, scene: Scene) -> Job:
        """Compose a case's sources, so that what would run is known before anything is built."""
        row = base_row(case, self.device.info, self._run_id)
        row["effects"] = effects_of(case, scene.medium.kernel)
        row["config_sha256"] = source.combined_hash(
            case.config_sha256, scene.medium.fingerprint, scene.segments.tobytes()
        )
        job = Job(case, row)
        if case.arithmetic == "double" and not self.device.info.fp64:
            row["reason"] = row["reason"] or "the device has no double precision"
        if row["reason"]:
            row["source_sha256"] = ""
            return job
        for count in (False, True):
            job.structure = structure_of(
                case, self._catalog, scene.medium, self.device, count=count
            )
            job.sources[count] = source.compose(job.structure)
        row["source_sha256"] = job.sources[False].sha256
        return job

    def run(self, scene: Scene, jobs: list[Job], seed: int) -> None:
        """Build and measure the jobs of one scene side by side; each row is written as it ends."""
        for job in jobs:
            if not job.sources:
                self._finish(job, job.row)
        data = {
            arithmetic: KernelData.upload(
                self.device, scene.segments, scene.medium.data, arithmetic
            )
            for arithmetic in {job.case.arithmetic for job in jobs if job.sources}
        }
        for job in jobs:
            if job.sources:
                self._guarded(job, lambda job=job: self._prepare(job, scene, data))
        benches = {i: job.bench for i, job in enumerate(jobs) if job.bench}
        self._measure(jobs, benches, scene, seed)

    def _measure(self, jobs: list[Job], benches: dict[int, Bench], scene: Scene, seed: int) -> None:
        def on_round(key: int, one: Round) -> None:
            self._on_progress(sum(b.progress for b in benches.values() if not b.measurement.stopped))

        for key in interleave(benches, seed, on_round, self._failed(jobs, benches)):
            job = jobs[key]
            values = reference(job.case.estimand, scene.medium, scene.segments)
            tracker = self._catalog.trackers[job.case.tracker]
            found = job.bench.measurement
            row = measured_row(job.row, tracker, found, values, job.bench.timed.lanes)
            self._finish(job, row, list(round_rows(row, found)))

    def _failed(self, jobs: list[Job], benches: dict[int, Bench]):
        def on_error(key: int, error: RunError) -> None:
            job = jobs[key]
            self._finish(job, job.row | {"status": "run_failed", "reason": _first_line(error)})

        return on_error

    def _guarded(self, job: Job, work: Callable[[], None]) -> None:
        """A case that cannot be built or run is a row; the others go on."""
        try:
            work()
        except BuildError as error:
            log = self.folder.folder / f"build-{job.case.case_id}.log"
            log.write_text(str(error), encoding="utf-8")
            self._finish(job, job.row | {"status": "build_failed", "reason": _first_line(error)})
        except RunError as error:
            self._finish(job, job.row | {"status": "run_failed", "reason": _first_line(error)})

    def _prepare(self, job: Job, scene: Scene, data: dict[str, KernelData]) -> None:
        case = job.case
        runners = {}
        for count, text in job.sources.items():
            program = self._program(text, job)
            runners[count] = runner_of(case, job.structure, scene, program, data[case.arithmetic])
        stop = case.stop
        rule = Rule(stop.error, stop.time_noise, stop.at_most, stop.samples)
        lanes_in_all = self.device.work_items[0] * job.structure.lanes
        bench = Bench(runners[True], runners[False], rule, lanes_in_all)
        bench.prepare()
        job.row["time_build_s"] = (job.row["time_build_s"] or 0.0) + bench.time_compile_s
        self.time_build_s += bench.time_compile_s
        job.bench = bench

    def _program(self, text: Source, job: Job) -> Program:
        """Build each source once; a case that shares it with another took no time to build."""
        if text.sha256 not in self._programs:
            self._programs[text.sha256] = program = self.device.build(text)
            job.row["time_build_s"] = (job.row["time_build_s"] or 0.0) + program.time_build_s
            self.time_build_s += program.time_build_s
        return self._programs[text.sha256]

    def _finish(self, job: Job, row: dict[str, Any], rounds: list[dict[str, Any]] = ()) -> None:
        self.folder.append(row, rounds)
        self._on_done(row)


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if "error" in line.lower()]
    return (lines or [str(error)])[0][:300]


def pending(folder: ResultFolder, jobs: list[Job]) -> list[Job]:
    """The jobs whose row an earlier, interrupted run has not left in the folder."""
    done = folder.keep({key_of(job.row) for job in jobs})
    return [job for job in jobs if key_of(job.row) not in done]
