"""A sweep: cases on devices, scene by scene, measured side by side, their rows written."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from freepath.cases.plan import Case
from freepath.compose.catalog import Catalog
from freepath.compose.source import Source
from freepath.config import Config
from freepath.device import limits
from freepath.device.compilers import first_error
from freepath.device.opencl import Device, Program
from freepath.errors import BuildError, DriverLimitError, FreepathError, RunError
from freepath.measure import equal_time, geometry, run_file
from freepath.measure.binding import runner_of
from freepath.measure.confirm import SETTLED, confirmed_rows
from freepath.measure.jobs import Job, inputs_of, scenes_of
from freepath.measure.pictures import COMPARED, are_there, openimageio, write_pictures
from freepath.measure.rounds import Bench, interleave
from freepath.measure.row import measured_row, round_rows
from freepath.measure.runner import KernelData
from freepath.measure.stopping import Rule
from freepath.results.folder import ResultFolder
from freepath.scene.volumes.files import COPIES

UNDER_WAY = "running, or killed"
TWICE = 2
"""So often a process may end at a case before that is given up: once may have been an accident."""


@dataclass
class Clock:
    """Seconds of a run by what they went into."""

    started: float = field(default_factory=time.perf_counter)
    build_s: float = 0.0
    device_s: float = 0.0

    @property
    def outside_s(self) -> float:
        """Since the start, without compilation."""
        return time.perf_counter() - self.started - self.build_s

    def as_dict(self) -> dict[str, float]:
        """What run.json says of it."""
        return {
            "time_wall_s": self.outside_s + self.build_s,
            "time_build_s": self.build_s,
            "time_device_s": self.device_s,
            "device_time_share": self.device_s / max(self.outside_s, 1e-9),
        }


class Listener:
    """What is reported of a sweep as it goes on; this one does not listen."""

    def row(self, row: dict[str, Any]) -> None:
        """A row was written."""

    def rounds(self, *kinds: list[dict[str, Any]]) -> None:
        """The rows of rounds, and of what was confirmed, of the row that follows; if asked for."""

    def progress(self, done: float, total: int, what: str) -> None:
        """So many cases are done, of so many, and this is being done."""

    def look(self, number: int) -> None:
        """Told a few times a second of a sweep that is watched: the number of the job at work."""


@dataclass
class Sweep:
    """Cases on devices, writing into one folder; `run` measures them."""

    config: Config
    catalog: Catalog
    cases: list[Case]
    devices: list[Device]
    folder: ResultFolder
    listener: Listener = field(default_factory=Listener)
    clock: Clock = field(default_factory=Clock)
    confirm: bool = False
    """Whether the error that each case predicts is measured as well."""
    work_group: int | None = None
    """Work-items of a group; None for what is best known or found."""
    beside: dict[str, Any] = field(default_factory=dict)
    """What run.json says of this session beside the rest."""
    files: dict[str, Path] = field(default_factory=dict)
    """Copies of files that the config names, by these names: where another machine has them."""
    tells_rounds: bool = False
    """Whether the listener hears of the rows of rounds too."""
    elsewhere: Callable[[list[list[Job]]], None] | None = None
    """Measures groups of jobs on other machines, and has their rows written here."""
    run_id: str = field(default_factory=lambda: uuid.uuid4().hex[:12])
    total: int = 0
    ended: int = 0
    deaths: dict[int, list[dict[str, str]]] = field(default_factory=dict)
    """By the number of a job: how a process ended at it, as its row would say."""
    state: np.ndarray = field(default_factory=lambda: np.array([0.0, -1.0]))
    """Since when the driver is at work, as of a device, and the number of the job at work."""
    _shots: list[equal_time.Shot] = field(default_factory=list)
    """Cases of the scene at work that were measured, where they get pictures."""
    _numbers: dict[Job, int] = field(default_factory=dict)
    _programs: dict[tuple[str, str], Program | BuildError] = field(default_factory=dict)

    def run(self) -> None:
        """Measure everything that is not in the folder already.

        The folder is made when all that can be wrong with config and volumes has been found. Its
        run.json is there from then on, and says at the end how the run ended.
        """
        for device in self.devices:
            device.group_by(self.work_group)
            device.state = self.state
        if self.config.render:
            openimageio()  # or the pictures would be missed only when all is measured
        self.total = self.total if self.deaths else len(self.cases) * len(self.devices)
        self.progress(0.0, "preparing scenes")
        COPIES.update(self.files)
        scenes = scenes_of(self.cases, self.config.search_path)
        jobs = [
            Job.of(case, device, scenes[case], self.catalog, self.run_id)
            for device in self.devices
            for case in self.cases
        ]
        self._numbers = {job: number for number, job in enumerate(jobs)}
        done = self.folder.open([job.row for job in jobs], self._is_whole, self.run_id)
        left = [job for job in jobs if job.key not in done]
        # of a process that goes on where another one ended, those are left which that had left
        self.total = self.total if self.deaths else len(left)
        self.ended = self.total - len(left)
        if not left:
            self.folder.close()
            return
        facts = run_file.facts_of(self.config, self.devices, jobs)
        facts["inputs"] = inputs_of(scenes)
        session = run_file.session_of(self.run_id, self.devices, self.total)
        ended = "failed"
        try:
            run_file.write(self.folder, facts, session | self.beside | {"ended": UNDER_WAY})
            for device in self.devices:
                device.compiler_log = self.folder.folder.resolve() / "compiler.log"
            if self.elsewhere:
                self.elsewhere(self.groups(left))
            else:
                for group in self.groups(left):
                    self._run(group)
            ended = "complete"
        except KeyboardInterrupt:
            ended = "interrupted"
            raise
        finally:
            for device in self.devices:
                device.compiler_log = None
            ending = {"ended": ended, **self.clock.as_dict()}
            run_file.write(self.folder, facts, session | self.beside | ending)
            self.folder.close()

    def _is_whole(self, row: dict[str, str]) -> bool:
        """Whether a row ran in the wanted work-groups, and the pictures that it needs are there."""
        if self.work_group and row["work_group"] not in ("", str(self.work_group)):
            return False
        rays = self.cases[0].rays  # all cases of a config fly the same
        return not self.config.render or are_there(self.folder.folder, row, rays)

    def groups(self, jobs: list[Job]) -> list[list[Job]]:
        """Jobs that are measured in turns: those of a scene on a device.

        Those at which a process ended come alone, and last: if one ends it again, it takes none of
        the others with it.
        """
        found: dict[Any, list[Job]] = {}
        for job in sorted(jobs, key=lambda job: bool(self._deaths_at(job))):
            found.setdefault(job if self._deaths_at(job) else job.place, []).append(job)
        return list(found.values())

    def progress(self, under_way: float, what: str) -> None:
        """Report it; `under_way` is how many cases' worth of those at work is done."""
        self.listener.progress(self.ended + under_way, self.total, what)

    def _deaths_at(self, job: Job) -> list[dict[str, str]]:
        """How a process of this run ended, each time one did while this case was at work."""
        return self.deaths.get(self._numbers[job], [])

    def given_up(self, job: Job) -> bool:
        """Tell whether processes ended at a job so often that its row says so, and write that."""
        if len(self._deaths_at(job)) < TWICE:
            return False
        *_, last = self._deaths_at(job)
        reason = f"{last['reason']}, also when it was tried again alone"
        self.finish(job.row | last | {"reason": reason})
        return True

    def died(self, job: Job) -> bool:
        """Whether a process of this run ended while this case was at work."""
        return bool(self._deaths_at(job))

    def died_at(self, job: Job, verdict: dict[str, str]) -> None:
        """Note how a process ended, as the row of the job at work would say."""
        self.deaths.setdefault(self._numbers[job], []).append(verdict)

    def _work_at(self, job: Job) -> None:
        self.state[1] = self._numbers[job]
        self.folder.note(job.case.name)

    def _run(self, jobs: list[Job]) -> None:
        """Build and measure jobs side by side; each row is written as it ends."""
        ready = []
        for job in jobs:
            if self.given_up(job):
                continue
            if job.timed is None:
                self.finish(job.row)
            else:
                ready.append(job)
        data: dict[tuple[str, str], KernelData] = {}
        for place, job in enumerate(ready, 1):
            self.progress(0.0, f"building {place}/{len(ready)}")
            self._work_at(job)
            try:
                self._prepare(job, data)
            except (BuildError, RunError, MemoryError) as error:
                self._fail(job, error)
        self._measure([job for job in ready if job.bench])

    def _prepare(self, job: Job, data: dict[tuple[str, str], KernelData]) -> None:
        case, scene, stop = job.case, job.scene, job.case.stop
        job.row["time_build_s"] = 0.0
        programs = [self._program(job, text) for text in (job.timed, job.counting)]
        stored, key = scene.as_stored(case), (case.arithmetic, case.storage)
        if key not in data:
            medium = stored.medium.data
            data[key] = KernelData.upload(job.device, scene.segments, medium, case.arithmetic)
        timed, counting = (
            runner_of(case, job.structure, stored, program, data[key]) for program in programs
        )
        samples = limits.samples_of(stop.samples, job.device.info)
        rule = Rule(stop.error, stop.time_noise, stop.at_most, samples, stop.rounds)
        rule = rule.confirming(SETTLED) if self.confirm else rule
        bench = Bench(timed, counting, rule)
        if geometry.is_open(job.device.info):
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
        key = job.device.info.label, text.sha256
        if key not in self._programs:
            try:
                program = job.device.build(text)
            except BuildError as error:
                self._programs[key] = error
                log = self.folder.write_log(f"build-{text.sha256[:12]}.log", str(error))
                raise BuildError(f"{first_error(error)} ({log.name})") from error
            self._programs[key] = program
            self._add_build(job, program.time_build_s)
        found = self._programs[key]
        if isinstance(found, BuildError):
            raise found
        return found

    def _add_build(self, job: Job, seconds: float) -> None:
        job.row["time_build_s"] += seconds
        self.clock.build_s += seconds

    def _measure(self, jobs: list[Job]) -> None:
        by_bench = {job.bench: job for job in jobs}
        self.progress(0.0, "computing references")
        for job in jobs:
            # now, and not between two rounds
            self._work_at(job)
            try:
                job.scene.reference(job.case)
                job.scene.as_stored(job.case).reference(job.case)
            except MemoryError as error:
                self._fail(by_bench.pop(job.bench), error)

        def on_turn(bench: Bench) -> None:
            self._work_at(by_bench[bench])

        def on_error(bench: Bench, error: RunError | MemoryError) -> None:
            self._fail(by_bench[bench], error)

        for bench in interleave(by_bench, self.config.seed, on_error, on_turn):
            if bench.measurement.stopped:
                self._measured(by_bench[bench])
            open_ones = [b for b in by_bench if not b.measurement.stopped]
            under_way = sum(b.progress for b in open_ones)
            self.progress(under_way, f"measuring {len(open_ones)} cases")
        self._render_at_equal_time()

    def _render_at_equal_time(self) -> None:
        """Pictures that can be compared, once it is known what a sample of each case takes."""
        shots, self._shots = self._shots, []
        if not shots:
            return
        self.progress(0.0, "pictures at equal time")
        try:
            told = equal_time.render(self.folder.folder, shots, self.folder.rows())
        except RunError as error:
            told = [str(error)]
        if told:
            self.folder.write_log(equal_time.LOG, "\n".join(told) + "\n")

    def _measured(self, job: Job) -> None:
        found, scene = job.bench.measurement, job.scene
        values, stored = scene.reference(job.case), scene.as_stored(job.case)
        largest = stored.largest_score(job.case)
        claimed = None if stored is scene else stored.reference(job.case)
        row = measured_row(job.row, job.tracker, found, values, largest, claimed)
        if self.config.render:
            wrong = write_pictures(self.folder.folder, row, job.case.rays, found.moments)
            row["reason"] = "; ".join(filter(None, (row["reason"], wrong)))
            if row["status"] in COMPARED:
                self._shots.append(equal_time.Shot(row, job.bench, job.case.rays, job.unbiased))
        confirmed = []
        if self.confirm and row["status"] == "ok" and values is not None:
            try:
                confirmed = confirmed_rows(row, job.bench, values)
            except RunError as error:
                return self._fail(job, error)
            self.clock.device_s += found.time_device_s - row["time_device_s"]
        return self.finish(row, list(round_rows(row, found)), confirmed)

    def _fail(self, job: Job, error: FreepathError | MemoryError) -> None:
        """A case that cannot be built or run is a row; the others go on."""
        if isinstance(error, MemoryError):
            error = RunError(f"out of memory: {error}")
        status = "build_failed" if isinstance(error, BuildError) else "run_failed"
        if isinstance(error, DriverLimitError):
            status = "skipped"
        self.finish(job.row | {"status": status, "reason": first_error(error)})

    def finish(self, row: dict[str, Any], *further: list[dict[str, Any]]) -> None:
        """Write a row with those of its rounds and of what was confirmed, and report it."""
        self.folder.append(row, *further)
        self.ended += 1
        self.clock.device_s += float(row["time_device_s"] or 0.0)
        self.listener.rounds(*further)
        self.listener.row(row)
