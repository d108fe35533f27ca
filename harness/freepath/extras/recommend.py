"""Which tracker and majorant are the fastest to an accuracy in a volume: successive halving."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from freepath import api
from freepath.cases import plan
from freepath.compose.catalog import ANY, Catalog
from freepath.device.selection import Part
from freepath.errors import NothingMatchedError, RunError
from freepath.measure import worker
from freepath.measure.ladder import Ladder
from freepath.measure.sweep import Clock, Listener, Sweep
from freepath.scene.volumes.reading import read_volume
from freepath.show import answers
from freepath.show.table import failures, number, uncertainty

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
USUAL: dict[str, Any] = {"delta": {}}
"""The tracker that, with one majorant, ratios are of: measured too, where it is searched."""
CONFIG = "recommended.yaml"
Axes = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Finding:
    """A case with its device seconds per ray to the accuracy asked for, and how to measure it."""

    case: answers.Case
    axes: Axes
    """Tracker, majorant and tightness as a config has them."""

    @property
    def rank(self) -> tuple[bool, float]:
        """By its time; what is not known comes behind all that is."""
        return not self.case.settled, self.case.time_s

    @property
    def hope(self) -> tuple[bool, float]:
        """By the lower end of its interval: what is known roughly is not given up for that."""
        return not self.case.settled, self.case.time_s * max(0.0, 1.0 - self.case.noise)


@dataclasses.dataclass
class Search:
    """Rounds of sweeps in one volume, each of fewer cases that are measured longer."""

    known: Catalog
    part: Part
    """A driver with one device."""
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
    found: dict[str, Finding] = dataclasses.field(default_factory=dict)
    """By the name of the case, the last known of all rounds; without those that went wrong."""

    def run(self) -> list[Finding]:
        """The finalists, the fastest first.

        Raises RunError where no case reaches the accuracy, or none is known to.
        """
        shape, side = self.voxels()
        majorants = majorants_of(shape)
        points = [
            {"tracker": tracker, "majorant": majorants[middle_of(majorants)], "tightness": 1}
            for tracker in self.trackers(side)
        ]
        usual = [one | {"majorant": "global"} for one in points if one["tracker"] == USUAL]
        self._round(0, [*points, *self._global_only(points), *usual])
        best = self._few(TRACKERS, by=lambda one: next(iter(one.axes["tracker"])))
        self._round(
            1, [one.axes | {"majorant": m, "tightness": 1} for one in best for m in majorants]
        )
        self._round(2, [one.axes | {"tightness": t} for one in self._few(CASES) for t in TIGHTNESS])
        self._round(3, [one.axes for one in self._few(FINALISTS)])
        finalists = sorted(self.found.values(), key=lambda one: one.rank)[:FINALISTS]
        if not finalists[0].case.settled:
            raise RunError(
                "the fastest is not known: of no case is the variance settled; give it more time "
                f"by --budget; what was measured is in {self.folder}"
            )
        return finalists

    def _few(
        self, count: int, by: Callable[[Finding], str] = lambda one: one.case.case
    ) -> list[Finding]:
        """The best of all rounds, each of another kind."""
        best: dict[str, Finding] = {}
        for one in sorted(self.found.values(), key=lambda one: one.hope):
            best.setdefault(by(one), one)
        return list(best.values())[:count]

    def voxels(self) -> tuple[tuple[int, ...], float]:
        """Counts along x, y, z, and the shortest side in the world."""
        keys = self.medium["volume"]
        volume = read_volume(Path(keys["file"]), keys.get("grid"))
        sides = np.linalg.norm(volume.to_world[:, :3], axis=0)
        return tuple(reversed(volume.densities.shape)), float(sides.min())

    def trackers(self, side: float) -> list[Axes]:
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

    def _round(self, turn: int, points: Sequence[Axes]) -> None:
        """Measure cases, and note those that reach the accuracy."""
        self.folder.mkdir(parents=True, exist_ok=True)
        seconds = max(LEAST_S, self.budget_s * SHARES[turn] / len(points))
        stop = PRECISION[turn] | {"at_most": f"{seconds:.3g} s"}
        config = self.folder / f"round-{turn + 1}.yaml"
        config.write_text(self.config_text(points, stop), "utf-8")
        sweep = self.measure(config)
        by_id = {case.case_id: case for case in sweep.cases}
        rows = sweep.folder.rows()
        self.measured += sum(row["status"] == "ok" for row in rows)
        for row in rows:
            self.note(row, axes_of(by_id[row["case_id"]]))
        if not self.found:
            raise RunError(self._why_none(rows, sweep.folder.folder))

    def measure(self, config: Path) -> Sweep:
        """Run a config into the folder beside it."""
        sweep = api.sweep(
            config,
            config.with_suffix(""),
            known=self.known,
            listener=self.listener,
            clock=self.clock,
        )
        worker.run(sweep, self.part)
        return sweep

    def note(self, row: dict[str, str], axes: Axes) -> None:
        """Keep what a row of summary.csv says of a case; what went wrong once is out."""
        time = needed(row, self.accuracy) if row["status"] == "ok" else None
        one = answers.case_of(row, time) if time else None
        old = self.found.get(row["case"])
        if one is None:
            self.found.pop(row["case"], None)
        elif one.settled or old is None or not old.case.settled:
            self.found[row["case"]] = Finding(one, axes)

    def _why_none(self, rows: Sequence[dict[str, str]], folder: Path) -> str:
        failed = failures(rows)
        told = [f"{len(failed)} failed; {one['status']}: {one['reason']}" for one in failed[:1]]
        if len(failed) == len(rows):
            return f"no case could be measured: {told[0]}"
        why = (
            f"no case reaches a relative error of {100 * self.accuracy:g} %: the transmittance "
            f"is 0, or biases are larger; see {folder}"
        )
        return "; ".join([why, *told])

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
        what = f"{self.estimand} to {100 * self.accuracy:g} %: the first case is the fastest"
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


def surely(first: answers.Case, second: answers.Case) -> float:
    """The chance that the first is the faster one, errors of both taken as normal."""
    spread = math.hypot(first.time_s * first.noise, second.time_s * second.noise) / 1.96
    if not spread:
        return 1.0
    return float(stats.norm.cdf((second.time_s - first.time_s) / spread))
