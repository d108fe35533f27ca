"""Which tracker and majorant reach an accuracy soonest in a volume: successive halving."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from freepath import api, plan
from freepath.catalog import ANY, Catalog
from freepath.device import Device
from freepath.errors import NothingMatchedError, RunError
from freepath.ladder import Ladder
from freepath.scene.volumes import read_volume
from freepath.sweep import Clock, Listener
from freepath.table import number, uncertainty
from scipy import stats

SEED = 7
RAYS = {"orthographic": {"resolution": [32, 32], "direction": [0.3, 0.2, 1]}}
CELLS = (32, 16, 8, 4)
"""Voxels along a side of a majorant's cell."""
TIGHTNESS = (1, 1.5, 2.5)
SHARES = (0.25, 0.3, 0.2, 0.25)
"""Of the budget, for each round."""
TRACKERS, CASES, FINALISTS = 5, 5, 5
"""How many are left after each round."""
PRECISION = ({"error": "10%", "time_noise": "10%"},) * 3 + ({"error": "1%", "time_noise": "1%"},)
LEAST_S = 0.05
CONFIG = "recommended.yaml"
Axes = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Finding:
    """A case, and the device seconds that a ray of it takes to the accuracy asked for."""

    name: str
    axes: Axes
    """Tracker, majorant and tightness as a config has them."""
    time_s: float
    """Infinite where the bias alone is larger."""
    noise: float
    """Half the 95 % interval of the time, relative to it."""

    @property
    def soonest_s(self) -> float:
        """The lower end of its interval: what is not known well is not given up for it."""
        return self.time_s * max(0.0, 1.0 - self.noise)


@dataclasses.dataclass
class Search:
    """Rounds of sweeps in one volume, each of fewer cases that are measured longer."""

    known: Catalog
    device: Device
    folder: Path
    medium: Axes
    """The volume as a config has it."""
    estimand: str
    accuracy: float
    """Relative RMSE."""
    budget_s: float
    """Seconds of measuring, over all rounds; compilation comes on top."""
    listener: Listener
    clock: Clock
    only: str = ""
    """A regular expression that names of trackers match."""
    measured: int = 0

    def run(self) -> list[Finding]:
        """The finalists, soonest first; raises RunError where no case reaches the accuracy."""
        shape, side = self._voxels()
        majorants = majorants_of(shape)
        points = [
            {"tracker": tracker, "majorant": majorants[middle_of(majorants)], "tightness": 1}
            for tracker in self._trackers(side)
        ]
        found = self._round(0, [*points, *self._global_only(points)])
        best = _few(found, TRACKERS, by=lambda one: next(iter(one.axes["tracker"])))
        found = self._round(
            1, [one.axes | {"majorant": m, "tightness": 1} for one in best for m in majorants]
        )
        best = _few(found, CASES)
        found = self._round(2, [one.axes | {"tightness": t} for one in best for t in TIGHTNESS])
        found = self._round(3, [one.axes for one in _few(found, FINALISTS)])
        return sorted(found, key=lambda one: one.time_s)

    def every(self) -> list[Axes]:
        """The cases that the search is over: what a full sweep measures."""
        shape, side = self._voxels()
        majorants = majorants_of(shape)
        return [
            {"tracker": tracker, "majorant": majorant, "tightness": tightness}
            for tracker in self._trackers(side)
            for majorant in majorants
            for tightness in TIGHTNESS
        ]

    def _voxels(self) -> tuple[tuple[int, ...], float]:
        """Counts along x, y, z, and the shortest side in the world."""
        keys = self.medium["volume"]
        volume = read_volume(Path(keys["file"]), keys.get("grid"))
        sides = np.linalg.norm(volume.to_world[:, :3], axis=0)
        return tuple(reversed(volume.densities.shape)), float(sides.min())

    def _trackers(self, side: float) -> list[Axes]:
        """Those of the estimand with their defaults; lengths in them are one voxel, and four."""
        found = []
        for tracker in self.known.trackers.values():
            if self.estimand not in tracker.estimands or "closed_form" in tracker.needs:
                continue
            if tracker.channels == ANY or not re.search(self.only, tracker.name):
                continue  # a volume is grey: those of any number of channels have twins of one
            lengths = [n for n, p in tracker.parameters.items() if p.unit == "length"]
            for factor in (1, 4) if lengths else (1,):
                found.append({tracker.name: dict.fromkeys(lengths, factor * side)})
        if not found:
            raise NothingMatchedError(f"no tracker of {self.estimand} matches '{self.only}'")
        return found

    def _global_only(self, points: Iterable[Axes]) -> list[Axes]:
        """Trackers that work with a global majorant alone."""
        return [
            point | {"majorant": "global"}
            for point in points
            for name in point["tracker"]
            if "grid" not in self.known.trackers[name].majorants
        ]

    def _round(self, turn: int, points: Sequence[Axes]) -> list[Finding]:
        """Measure cases; those that reach the accuracy."""
        self.folder.mkdir(parents=True, exist_ok=True)
        seconds = max(LEAST_S, self.budget_s * SHARES[turn] / len(points))
        stop = PRECISION[turn] | {"at_most": f"{seconds:.3g} s"}
        config = self.folder / f"round-{turn + 1}.yaml"
        config.write_text(self.config_text(points, stop), "utf-8")
        rows, by_id = self.measure(config)
        rows = [row for row in rows if row["status"] == "ok"]
        self.measured += len(rows)
        found = [self._finding(by_id[row["case_id"]], row) for row in rows]
        reaching = [one for one in found if one and math.isfinite(one.time_s)]
        if not reaching:
            raise RunError(
                f"no case reaches a relative error of {100 * self.accuracy:g} %: the transmittance "
                f"is 0, or biases are larger; see {config.with_suffix('')}"
            )
        return reaching

    def measure(self, config: Path) -> tuple[list[dict[str, str]], dict[str, plan.Case]]:
        """Run a config into the folder beside it: its rows, and its cases by their ids."""
        sweep = api.sweep(
            config,
            config.with_suffix(""),
            known=self.known,
            devices=[self.device],
            listener=self.listener,
            clock=self.clock,
        )
        sweep.run()
        return sweep.folder.rows(), {case.case_id: case for case in sweep.cases}

    def _finding(self, case: plan.Case, row: dict[str, str]) -> Finding | None:
        found = needed(row, self.accuracy)
        return Finding(case.name, axes_of(case), *found) if found else None

    def config_text(self, points: Sequence[Axes], stop: Axes) -> str:
        """A config of these cases, in YAML (JSON is YAML)."""
        first, *others = (dict(point) for point in points)
        matrix = {"estimand": self.estimand, "medium": [self.medium], **first}
        lines = [
            f"name: {self.folder.name}",
            f"seed: {SEED}",
            f"rays: {json.dumps(RAYS)}",
            "matrix:",
            *(f"  {axis}: {json.dumps(value)}" for axis, value in matrix.items()),
            *(["include:"] if others else []),
            *(f"  - {json.dumps(point)}" for point in others),
            f"stop: {json.dumps(stop)}",
        ]
        return "\n".join(lines) + "\n"

    def write(self, finalists: Sequence[Finding]) -> Path:
        """Write the config that measures the finalists again, the best first."""
        path = self.folder / CONFIG
        text = self.config_text([one.axes for one in finalists], PRECISION[-1] | {"at_most": "5 s"})
        what = f"{self.estimand} to {100 * self.accuracy:g} %: the first case is soonest"
        path.write_text(f"# {what}; the others came next.\n{text}", encoding="utf-8")
        return path


def needed(row: dict[str, str], accuracy: float) -> tuple[float, float] | None:
    """Device seconds a ray to a relative RMSE, and half their 95 % interval relative to them.

    Infinite where the bias alone is larger. None where the row does not say.
    """
    variance, scale = number(row, "variance"), number(row, "reference")
    scale = number(row, "estimate") if scale is None else scale
    time = number(row, "time_per_sample_s")
    if variance is None or not scale or not time:
        return None
    needs = Ladder(number(row, "bias_rms") or 0.0, variance, time).time_to(accuracy * scale)
    noises = number(row, "time_noise"), number(row, "variance_noise")
    return needs, uncertainty(needs, time, *noises)


def majorants_of(shape: Sequence[int]) -> list[Any]:
    """A global one, grids of several resolutions, and an octree, for voxels (x, y, z)."""
    grids: list[Any] = []
    for cells in CELLS:
        resolution = [max(1, math.ceil(count / cells)) for count in shape]
        if {"grid": {"resolution": resolution}} not in grids and max(resolution) > 1:
            grids.append({"grid": {"resolution": resolution}})
    finest = 2 ** max(1, min(9, math.ceil(math.log2(max(2, max(shape) / CELLS[-1])))))
    return ["global", *grids, {"octree": {"resolution": finest}}]


def middle_of(majorants: Sequence[Any]) -> int:
    """The place of the grid of medium resolution: what most trackers are good with."""
    grids = [i for i, one in enumerate(majorants) if "grid" in one]
    return grids[(len(grids) + 1) // 2 - (len(grids) == 1)] if grids else 0


def axes_of(case: plan.Case) -> Axes:
    """Tracker, majorant and tightness of a case, as a config has them."""
    majorant = "global" if case.majorant is None else case.majorant.as_dict()
    tightness = 1 if case.tightness is None else case.tightness
    tracker = {case.tracker: dict(case.params)}
    return {"tracker": tracker, "majorant": majorant, "tightness": tightness}


def _few(
    found: Sequence[Finding], count: int, by: Callable[[Finding], str] = lambda one: one.name
) -> list[Finding]:
    """The best by the lower end of their interval, each of another kind."""
    best: dict[str, Finding] = {}
    for one in sorted(found, key=lambda one: one.soonest_s):
        best.setdefault(by(one), one)
    return list(best.values())[:count]


def surely(first: Finding, second: Finding) -> float:
    """The chance that the first is the sooner one, errors of both taken as normal."""
    spread = math.hypot(first.time_s * first.noise, second.time_s * second.noise) / 1.96
    if not spread:
        return 1.0
    return float(stats.norm.cdf((second.time_s - first.time_s) / spread))
