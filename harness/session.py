"""A whole run: a config's cases on devices, and what run.json tells of it."""

from __future__ import annotations

import dataclasses
import datetime
import math
import os
import re
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

from freepath import environment, limits, majorants
from freepath.binding import Scene
from freepath.catalog import Catalog
from freepath.config import Config
from freepath.device import Device
from freepath.errors import FreepathError, UsageError
from freepath.pictures import are_there
from freepath.plan import Case
from freepath.results import SCHEMA_VERSION, ResultFolder, key_of
from freepath.scene import build_medium
from freepath.source import BUILD_OPTIONS, combined_hash
from freepath.sweep import Job, Sweep

RESULTS = Path("results")
STAMP = "%Y%m%d-%H%M%S"


@dataclasses.dataclass
class Clock:
    """Seconds of a run by what they went into."""

    started: float
    build_s: float = 0.0
    device_s: float = 0.0

    @property
    def wall_s(self) -> float:
        """Since the start."""
        return time.perf_counter() - self.started

    @property
    def outside_s(self) -> float:
        """Since the start, without compilation."""
        return self.wall_s - self.build_s

    def as_dict(self) -> dict[str, float]:
        """What run.json says of it."""
        return {
            "time_wall_s": self.wall_s,
            "time_build_s": self.build_s,
            "time_device_s": self.device_s,
            "device_time_share": self.device_s / max(self.outside_s, 1e-9),
        }


def search_path(config: Config) -> list[Path]:
    """Where volumes and rays are looked for first: beside the config."""
    return [config.path.parent] if config.path else []


def build_scenes(cases: list[Case], folders: list[Path]) -> dict[str, Scene]:
    """Read or make every medium once, with its rays; keyed by `scene_key`."""
    scenes: dict[str, Scene] = {}
    for case in cases:
        key = scene_key(case)
        # what cannot be used is told before anything runs
        _check_memory(case)
        if key not in scenes:
            scenes[key] = Scene.of(case, build_medium(case.medium, folders), folders)
        scene = scenes[key]
        limits.check_units(case, scene.medium, float(scene.bounds((1, 1, 1))[1].max()))
        scenes[key].sky(case)
        scenes[key].as_stored(case)
    return scenes


def _check_memory(case: Case) -> None:
    """Refuse a majorant whose cells do not fit into what memory is left."""
    if case.majorant is None:
        return
    cells = math.prod(majorants.cells_of(case.majorant))
    needed, left = cells * majorants.BYTES_PER_CELL, environment.memory_left()
    if needed > left:
        sizes = f"{needed / 2**30:.3g} GiB, {left / 2**30:.3g} are left"
        raise UsageError(f"{case.name}: its majorant of {cells} cells takes {sizes}")


def scene_key(case: Case) -> str:
    """What cases of the same scene have in common; all cases of a config fly the same rays."""
    return str(case.medium.as_dict())


def _inputs(cases: list[Case], scenes: dict[str, Scene]) -> list[str]:
    """What is used of each file: of a volume its grid, of an image its channels."""
    told: dict[str, None] = {}
    for case in cases:
        scene = scenes[scene_key(case)]
        for one in (scene.medium, scene.sky(case)):
            told |= {one.told: None} if one is not None and one.told else {}
    # names of files, grids and channels may hold what moves a terminal's cursor
    return ["".join(c if c.isprintable() else "?" for c in one) for one in told]


def new_folder(name: str) -> Path:
    """A folder below results/ that is not there yet, named after the config and the time."""
    stem = f"{name}-{datetime.datetime.now().strftime(STAMP)}"
    numbered = (RESULTS / f"{stem}-{number}" for number in range(2, 1000))
    return next(path for path in (RESULTS / stem, *numbered) if not path.exists())


def newest_folder(name: str) -> Path:
    """The folder below results/ of the last run of a config; raises FreepathError without one."""
    stamped = re.compile(re.escape(name) + r"-[0-9]{8}-[0-9]{6}(-[0-9]+)?")
    found = [path for path in RESULTS.glob("*/") if stamped.fullmatch(path.name)]
    if not found:
        raise FreepathError(f"no run of {name} in {RESULTS}/ to resume; name its folder with -o")
    return max(found, key=lambda path: path.name)


@dataclasses.dataclass
class Run:
    """Runs cases on devices, one device after the other, one scene after the other."""

    config: Config
    catalog: Catalog
    cases: list[Case]
    folder: ResultFolder
    clock: Clock
    on_done: Callable[[dict[str, Any]], None]
    """Told every row once it is written."""
    on_progress: Callable[[float, int, str], None]
    """Told how many cases are done, of how many, and what is being done."""
    confirm: bool = False
    """Whether the error that each case predicts is measured as well."""
    run_id: str = dataclasses.field(default_factory=lambda: uuid.uuid4().hex[:12])
    total: int = 0
    ended: int = 0

    def execute(self, devices: list[Device]) -> None:
        """Measure everything that is not in the folder already.

        The folder is made when all that can be wrong with config and volumes has been found. Its
        run.json is there from then on, and says at the end how the run ended.
        """
        self.on_progress(0.0, len(self.cases) * len(devices), "preparing scenes")
        scenes = build_scenes(self.cases, search_path(self.config))
        plans = [(sweep, self._plan(sweep, scenes)) for sweep in map(self._sweep, devices)]
        jobs = [job for _, plan in plans for job in plan]
        done = self.folder.open([job.row for job in jobs], self._is_whole)
        self.total = sum(key_of(job.row) not in done for job in jobs)
        if not self.total:
            self.folder.close()
            return
        facts = self._describe(devices, jobs) | {"inputs": _inputs(self.cases, scenes)}
        session = self._session(devices)
        ended = "failed"
        try:
            self._write(facts, session | {"ended": "running, or killed"})
            for sweep, plan in plans:
                self._run(sweep, scenes, [job for job in plan if key_of(job.row) not in done])
            ended = "complete"
        except KeyboardInterrupt:
            ended = "interrupted"
            raise
        finally:
            self._write(facts, session | {"ended": ended, **self.clock.as_dict()})
            self.folder.close()

    def _is_whole(self, row: dict[str, str]) -> bool:
        """Whether the pictures of a row are there, where the config wants them."""
        rays = self.cases[0].rays  # all cases of a config fly the same
        return not self.config.render or are_there(self.folder.folder, row, rays)

    def _sweep(self, device: Device) -> Sweep:
        told = self._done, self._progress
        sweep = Sweep(device, self.catalog, self.folder, self.run_id, *told)
        sweep.confirm, sweep.render = self.confirm, self.config.render
        return sweep

    def _plan(self, sweep: Sweep, scenes: dict[str, Scene]) -> list[Job]:
        info = sweep.device.info
        return [sweep.plan(case, scenes[scene_key(case)].for_device(info)) for case in self.cases]

    def _run(self, sweep: Sweep, scenes: dict[str, Scene], jobs: list[Job]) -> None:
        suspects = [job for job in jobs if sweep.deaths_at(job)]
        others = [job for job in jobs if not sweep.deaths_at(job)]
        groups = [[job for job in others if scene_key(job.case) == key] for key in scenes]
        # alone, and after the others: a process that ends at one again takes none of them with it
        groups += [[job] for job in suspects]
        try:
            for group in filter(None, groups):
                scene = scenes[scene_key(group[0].case)].for_device(sweep.device.info)
                sweep.run(scene, group, self.config.seed)
        finally:
            self.clock.build_s += sweep.time_build_s
            self.clock.device_s += sweep.time_confirming_s

    def _done(self, row: dict[str, Any]) -> None:
        self.ended += 1
        self.clock.device_s += row["time_device_s"] or 0.0
        self.on_done(row)

    def _progress(self, under_way: float, what: str) -> None:
        self.on_progress(self.ended + under_way, self.total, what)

    def _describe(self, devices: list[Device], jobs: list[Job]) -> dict[str, Any]:
        """What is so for the whole run."""
        hashes = ("case_id", "case", "device", "config_sha256", "source_sha256")
        return {
            "schema_version": SCHEMA_VERSION,
            "config_file": str(self.config.path),
            "config": self.config.as_dict(),
            "config_text": self.config.text,
            "config_sha256": combined_hash(self.config.text),
            "seed": self.config.seed,
            "devices": [dataclasses.asdict(device.info) for device in devices],
            "build_options": {name: list(options) for name, options in BUILD_OPTIONS.items()},
            "cases": [{name: job.row[name] for name in hashes} for job in jobs],
        }

    def _session(self, devices: list[Device]) -> dict[str, Any]:
        """What is so until the run ends or is interrupted, and may be otherwise when it goes on."""
        return {
            "run_id": self.run_id,
            "started": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
            "process": os.getpid(),
            "devices": [device.info.label for device in devices],
            "cases_to_run": self.total,
            "host": environment.describe(),
        }

    def _write(self, facts: dict[str, Any], session: dict[str, Any]) -> None:
        before = self.folder.read_run()
        sessions = before.get("sessions")
        earlier = sessions if isinstance(sessions, list) else []
        others = [s for s in earlier if isinstance(s, dict) and s.get("run_id") != self.run_id]
        merged = {name: _with_others(before, facts, name) for name in ("devices", "cases")}
        self.folder.write_run(facts | merged | {"sessions": [*others, session]})


def _with_others(before: dict[str, Any], now: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """A list of run.json, with what it held before of devices that this run has not."""
    labels = {device["name"] for device in now["devices"]}
    key = "name" if name == "devices" else "device"
    old = before.get(name)
    kept = [one for one in old or [] if isinstance(one, dict) and one.get(key) not in labels]
    return [*kept, *now[name]]
