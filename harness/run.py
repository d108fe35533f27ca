"""A whole run: a config's cases on devices, with what is shown meanwhile and at its end."""

from __future__ import annotations

import dataclasses
import datetime
import os
import time
import uuid
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from freepath import environment
from freepath.catalog import Catalog
from freepath.config import Config
from freepath.device import Device
from freepath.errors import FreepathError
from freepath.plan import Case
from freepath.results import ResultFolder
from freepath.scene import Medium, build_medium
from freepath.sweep import Job, Scene, Sweep, pending

FAILED = ("invalid", "build_failed", "run_failed", "timeout", "crashed", "mismatch")


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
    def device_share(self) -> float:
        """Device time over all wall time outside compilation."""
        return self.device_s / max(self.wall_s - self.build_s, 1e-9)


def search_path(config: Config) -> list[Path]:
    """Where volumes and rays are looked for first: beside the config."""
    return [config.path.parent] if config.path else []


def build_media(cases: list[Case], folders: list[Path]) -> dict[str, Medium]:
    """Read or make every medium once, before anything runs; keyed by its model's text."""
    media: dict[str, Medium] = {}
    for case in cases:
        key = str(case.medium.as_dict())
        if key not in media:
            media[key] = build_medium(case.medium, folders)
    return media


def folder_of(name: str, *, resume: bool) -> Path:
    """A new folder below results/, named after the config and the time, or its newest to resume."""
    if resume:
        found = sorted(Path("results").glob(f"{name}-[0-9]*"))
        if not found:
            raise FreepathError(f"no run of {name} in results/ to resume; name its folder with -o")
        return found[-1]
    stamp = datetime.datetime.now().strftime("%Y%m%d-%H%M%S")
    return Path("results") / f"{name}-{stamp}"




class Run:
    """Runs cases on devices, one device after the other, one scene after the other."""

    def __init__(
        self,
        config: Config,
        catalog: Catalog,
        cases: list[Case],
        folder: ResultFolder,
        clock: Clock,
        on_done: Callable[[dict[str, Any]], None],
        on_progress: Callable[[float, float], None],
    ):
        self.run_id = uuid.uuid4().hex[:12]
        self.cases = cases
        self.folder = folder
        self._config = config
        self._catalog = catalog
        self._clock = clock
        self._on_done = on_done
        self._on_progress = on_progress
        self._facts: dict[str, Any] = {}
        self.total = len(cases)
        self.ended = 0

    def execute(self, devices: list[Device]) -> None:
        """Measure everything that is not in the folder already.

        run.json is there from the start, and says at the end whether the run was interrupted.
        """
        self._facts = self._describe(devices)
        self.folder.write_run(self._facts | {"state": "interrupted"})
        folders = search_path(self._config)
        media = build_media(self.cases, folders)
        scenes = {key: Scene.of(self.cases[0], medium, folders) for key, medium in media.items()}
        plans = [(sweep, self._plan(sweep, scenes)) for sweep in map(self._sweep, devices)]
        jobs = [job for _, plan in plans for group in plan.values() for job in group]
        left = {id(job) for job in pending(self.folder, jobs)}
        self.total = len(left)
        for sweep, plan in plans:
            for key, group in plan.items():
                sweep.run(scenes[key], [job for job in group if id(job) in left], self._config.seed)
            self._clock.build_s += sweep.time_build_s
        self.folder.write_run(self._facts | {"state": "complete", **self._times()})

    def _sweep(self, device: Device) -> Sweep:
        return Sweep(device, self._catalog, self.folder, self.run_id, self._done, self._progress)

    def _plan(self, sweep: Sweep, scenes: dict[str, Scene]) -> dict[str, list[Job]]:
        plan: dict[str, list[Job]] = defaultdict(list)
        for case in self.cases:
            key = str(case.medium.as_dict())
            plan[key].append(sweep.plan(case, scenes[key]))
        return plan

    def _done(self, row: dict[str, Any]) -> None:
        self.ended += 1
        self._clock.device_s += row["time_device_s"] or 0.0
        self._on_done(row)

    def _progress(self, under_way: float) -> None:
        self._on_progress(self.ended + under_way, self.total)

    def _times(self) -> dict[str, Any]:
        clock = self._clock
        return {
            "time_wall_s": clock.wall_s,
            "time_build_s": clock.build_s,
            "time_device_s": clock.device_s,
            "device_time_share": clock.device_share,
        }

    def _describe(self, devices: list[Device]) -> dict[str, Any]:
        return {
            "run_id": self.run_id,
            "started": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
            "process": os.getpid(),
            "config": self._config.as_dict(),
            "config_text": self._config.text,
            "seed": self._config.seed,
            "cases": [{"case_id": case.case_id, "case": case.name} for case in self.cases],
            "devices": [dataclasses.asdict(device.info) for device in devices],
            "host": environment.describe(),
        }


def failures(rows: list[dict[str, str]]) -> list[dict[str, str]]:
    """The rows of cases that went wrong."""
    return [row for row in rows if row["status"] in FAILED]
