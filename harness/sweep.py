"""Runs the cases of a plan on a device, medium by medium, and writes their rows."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from freepath import equal_time, geometry, limits, majorants, source
from freepath.binding import Scene, runner_of, structure_of
from freepath.catalog import Catalog
from freepath.compilers import first_error
from freepath.confirm import SETTLED, confirmed_rows
from freepath.device import Device, Program
from freepath.errors import BuildError, DriverLimitError, FreepathError, RunError
from freepath.journal import TWICE
from freepath.measure import Bench, interleave
from freepath.pictures import COMPARED, write_pictures
from freepath.plan import Case
from freepath.results import ResultFolder, key_of
from freepath.rows import base_row, effects_of, measured_row, round_rows
from freepath.runner import KernelData
from freepath.source import Source, Structure
from freepath.stopping import Rule

CRASHED = {
    "status": "crashed",
    "reason": f"the process ended {TWICE} times while this case was built or run; "
    "a run into another folder tries it again",
}


@dataclass(eq=False)
class Job:
    """A case on a device: its row so far, its sources, and its bench once it is built."""

    case: Case
    row: dict[str, Any]
    structure: Structure | None = None
    timed: Source | None = None
    """None where the case is skipped."""
    counting: Source | None = None
    bench: Bench | None = None


@dataclass
class Sweep:
    """Cases on one device, writing into one folder."""

    device: Device
    catalog: Catalog
    folder: ResultFolder
    run_id: str
    on_done: Callable[[dict[str, Any]], None]
    """Told every row once it is written."""
    on_progress: Callable[[float, str], None]
    """Told how many cases' worth is under way, and what is being done."""
    confirm: bool = False
    """Whether the error that a case predicts is measured as well."""
    render: bool = False
    """Whether cases whose rays have a picture get one."""
    time_build_s: float = 0.0
    time_confirming_s: float = 0.0
    """Device time that is in no row."""
    _shots: list[equal_time.Shot] = field(default_factory=list)
    """Cases of the scene at work that were measured, where they get pictures."""
    _programs: dict[str, Program | BuildError] = field(default_factory=dict)

    def plan(self, case: Case, scene: Scene) -> Job:
        """Compose a case's sources, so that what would run is known before anything is built."""
        row = base_row(case, self.device.info, self.run_id)
        row["effects"] = effects_of(case, scene.medium.kernel)
        row["rays"] = len(scene.segments)
        row["config_sha256"] = source.combined_hash(case.config_sha256, scene.fingerprint_of(case))
        if case.arithmetic == "double" and not self.device.info.fp64:
            row["reason"] = row["reason"] or "the device has no double precision"
        row["reason"] = row["reason"] or self._control_reason(case, scene)
        job = Job(case, row)
        if not row["reason"]:
            job.structure = self._structure(case, scene, count=False)
            along = job.structure.paths.names if job.structure.paths else ()
            row["effects"] = effects_of(case, scene.medium.kernel, along)
            job.timed = source.compose(job.structure)
            job.counting = source.compose(self._structure(case, scene, count=True))
            if self.device.info.slow_compiler:
                job.counting = job.counting.unoptimised()
            row["source_sha256"] = job.timed.sha256
        return job

    def _control_reason(self, case: Case, scene: Scene) -> str:
        """Why a tracker cannot take its control; '' where it can."""
        tracker = self.catalog.trackers[case.tracker]
        if "control" not in tracker.needs or tracker.bounding is not True:
            return ""
        excess = scene.as_stored(case).majorant(case, controlled=True).control_excess
        if excess <= majorants.EXCESS:
            return ""
        share = f"{case.params['share']:g} x {case.params['control']}"
        return f"{case.tracker} allows no control above the extinction, and {share} is somewhere"

    def _structure(self, case: Case, scene: Scene, *, count: bool) -> Structure:
        return structure_of(case, self.catalog, scene.medium, self.device, count=count)

    def deaths_at(self, job: Job) -> int:
        """How often the process of this run ended while this case was at work."""
        return self.folder.journal.deaths_at(key_of(job.row))

    def run(self, scene: Scene, jobs: list[Job], seed: int) -> None:
        """Build and measure the jobs of one scene side by side; each row is written as it ends."""
        self.device.compiler_log = self.folder.folder / "compiler.log"
        ready = []
        for job in jobs:
            if self.deaths_at(job) >= TWICE:
                self._finish(job, job.row | CRASHED)
            elif job.timed is None:
                self._finish(job, job.row)
            else:
                ready.append(job)
        data: dict[tuple[str, str], KernelData] = {}
        for place, job in enumerate(ready, 1):
            self.on_progress(0.0, f"building {place}/{len(ready)}")
            self.folder.journal.work_at(key_of(job.row))
            try:
                self._prepare(job, scene, data)
            except (BuildError, RunError) as error:
                self._fail(job, error)
        self._measure([job for job in ready if job.bench], scene, seed)

    def _prepare(self, job: Job, scene: Scene, data: dict[tuple[str, str], KernelData]) -> None:
        case, stop = job.case, job.case.stop
        job.row["time_build_s"] = 0.0
        programs = [self._program(job, text) for text in (job.timed, job.counting)]
        stored, key = scene.as_stored(case), (case.arithmetic, case.storage)
        if key not in data:
            medium = stored.medium.data
            data[key] = KernelData.upload(self.device, scene.segments, medium, case.arithmetic)
        timed, counting = (
            runner_of(case, job.structure, stored, program, data[key]) for program in programs
        )
        samples = limits.samples_of(stop.samples, self.device.info)
        rule = Rule(stop.error, stop.time_noise, stop.at_most, samples, stop.rounds)
        rule = rule.confirming(SETTLED) if self.confirm else rule
        bench = Bench(timed, counting, rule)
        if geometry.is_open(self.device.info):
            geometry.choose(bench)
        bench.prepare()
        self._add_build(job, bench.measurement.time_compile_s)
        job.row["source_bytes"] = len(job.timed.text.encode())
        job.row["binary_bytes"] = timed.program.binary_bytes
        job.row["work_items"], job.row["work_group"] = timed.program.work_items
        job.row["private_bytes"] = timed.program.told("PRIVATE_MEM_SIZE")
        job.bench = bench

    def _program(self, job: Job, text: Source) -> Program:
        """Build each source once; a case that shares it with another took no time to build."""
        if text.sha256 not in self._programs:
            try:
                program = self.device.build(text)
            except BuildError as error:
                self._programs[text.sha256] = error
                log = self.folder.write_log(f"build-{text.sha256[:12]}.log", str(error))
                raise BuildError(f"{first_error(error)} ({log.name})") from error
            self._programs[text.sha256] = program
            self._add_build(job, program.time_build_s)
        found = self._programs[text.sha256]
        if isinstance(found, BuildError):
            raise found
        return found

    def _add_build(self, job: Job, seconds: float) -> None:
        job.row["time_build_s"] += seconds
        self.time_build_s += seconds

    def _measure(self, jobs: list[Job], scene: Scene, seed: int) -> None:
        by_bench = {job.bench: job for job in jobs}
        self.on_progress(0.0, "computing references")
        for job in jobs:
            # now, and not between two rounds
            scene.reference(job.case)
            scene.as_stored(job.case).reference(job.case)

        def on_turn(bench: Bench) -> None:
            self.folder.journal.work_at(key_of(by_bench[bench].row))

        def on_error(bench: Bench, error: RunError) -> None:
            self._fail(by_bench[bench], error)

        for bench in interleave(by_bench, seed, on_error, on_turn):
            if bench.measurement.stopped:
                self._measured(by_bench[bench], scene)
            open_ones = [b for b in by_bench if not b.measurement.stopped]
            self.on_progress(
                sum(b.progress for b in open_ones), f"measuring {len(open_ones)} cases"
            )
        self._render_at_equal_time()

    def _render_at_equal_time(self) -> None:
        """Pictures that can be compared, once it is known what a sample of each case takes."""
        shots, self._shots = self._shots, []
        if not shots:
            return
        self.on_progress(0.0, "pictures at equal time")
        try:
            told = equal_time.render(self.folder.folder, shots, self.folder.rows())
        except RunError as error:
            told = [str(error)]
        if told:
            self.folder.write_log(equal_time.LOG, "\n".join(told) + "\n")

    def _measured(self, job: Job, scene: Scene) -> None:
        found = job.bench.measurement
        tracker = self.catalog.trackers[job.case.tracker]
        values, stored = scene.reference(job.case), scene.as_stored(job.case)
        largest = stored.largest_score(job.case)
        claimed = None if stored is scene else stored.reference(job.case)
        row = measured_row(job.row, tracker, found, values, largest, claimed)
        if self.render:
            wrong = write_pictures(self.folder.folder, row, job.case.rays, found.moments)
            row["reason"] = "; ".join(filter(None, (row["reason"], wrong)))
            if row["status"] in COMPARED:
                self._shots.append(
                    equal_time.Shot(row, job.bench, job.case.rays, self._unbiased(job))
                )
        confirmed = []
        if self.confirm and row["status"] == "ok" and values is not None:
            try:
                confirmed = confirmed_rows(row, job.bench, values)
            except RunError as error:
                return self._fail(job, error)
            self.time_confirming_s += found.time_device_s - row["time_device_s"]
        return self._finish(job, row, round_rows(row, found), confirmed)

    def _unbiased(self, job: Job) -> bool:
        shadow = job.case.shadow
        names = [job.case.tracker, *([] if shadow is None else [shadow.kind])]
        return all(self.catalog.trackers[name].unbiased for name in names)

    def _fail(self, job: Job, error: FreepathError) -> None:
        """A case that cannot be built or run is a row; the others go on."""
        status = "build_failed" if isinstance(error, BuildError) else "run_failed"
        if isinstance(error, DriverLimitError):
            status = "skipped"
        self._finish(job, job.row | {"status": status, "reason": first_error(error)})

    def _finish(self, job: Job, row: dict[str, Any], *further: Iterable[dict[str, Any]]) -> None:
        self.folder.append(row, *further)
        self.on_done(row)
