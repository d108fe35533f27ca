"""Which tracker and majorant are the fastest to an accuracy in a volume: successive halving."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from freepath import api
from freepath.cases import plan
from freepath.compose.catalog import ANY, Catalog
from freepath.device.selection import Part
from freepath.errors import NothingMatchedError, RunError
from freepath.extras.renderers import RATES, Renderer, contains
from freepath.measure import worker
from freepath.measure.jobs import scenes_of
from freepath.measure.ladder import Ladder
from freepath.measure.sweep import Clock, Listener, Sweep
from freepath.results.folder import RUN, SUMMARY, ResultFolder, Row, read_result, write
from freepath.scene import survey
from freepath.scene.volumes.reading import read_volume
from freepath.show import answers
from freepath.show.table import failures, number, uncertainty

SEED = 7
RAYS = {"orthographic": {"resolution": [32, 32], "direction": [0.3, 0.2, 1]}}
CELLS = (32, 16, 8, 4)
"""Voxels along a side of a majorant's cell."""
TIGHTNESS = (1, 1.5, 2.5)
STEPS = (1, 4)
"""Of marching, in voxels."""
FINEST_TREE = 512
SHARES = (0.2, 0.25, 0.2, 0.2, 0.15)
"""Of the budget, for each round; what one leaves is the others'."""
WHAT = ("trackers", "majorants", "tightness", "finalists", "beyond the edge of the search")
"""What a round is about."""
TRACKERS, CASES, FINALISTS = 5, 5, 5
"""How many are left after each round."""
PRECISION = ({"error": "10%", "time_noise": "10%"},) * 3 + (
    {"error": "1%", "time_noise": "1%"},
) * 2
LEAST_S = 0.05
OVER = 1.25
"""More than so many times its budget is told."""
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
    renderer: Renderer | None = None
    """What is recommended is what it has; all the rest is measured for the ratio."""
    timeout_s: float | None = None
    """What --timeout takes."""
    measured: int = 0
    spent_s: float = 0.0
    """Of the budget."""
    beside_s: float = 0.15
    """What a case of the last round took beside what it was given; a guess before the first."""
    lacks: list[str] = dataclasses.field(default_factory=list)
    """What the budget did not reach."""
    edge: str = ""
    """Whether the fastest lay at the edge of the search, and what lay beyond."""
    dense: str = ""
    """How dense the volume is."""
    side: float = 1.0
    """Of a voxel, the shortest, in the world."""
    had: list[Axes] = dataclasses.field(default_factory=list)
    """Points that the renderer has."""
    found: dict[str, Finding] = dataclasses.field(default_factory=dict)
    """By the name of the case, the last known of all rounds; without those that went wrong."""
    rows: dict[str, tuple[Row, list[Row]]] = dataclasses.field(default_factory=dict)
    """Its rows of summary.csv and samples.csv; of those that went wrong too."""

    def run(self) -> list[Finding]:
        """The finalists, the fastest first.

        Raises RunError where no case reaches the accuracy, or none is known to.
        """
        shape, self.side = self.voxels()
        majorants = majorants_of(shape)
        if self.renderer:
            tracker = "ratio" if self.estimand == "transmittance" else "delta"
            finest = majorants[-1]["octree"]["resolution"]
            self.had = self.renderer.points(tracker, finest, self.side)
        points = [
            {"tracker": tracker, "majorant": majorants[middle_of(majorants)], "tightness": 1}
            for tracker in self.trackers(self.side)
        ]
        usual = [one | {"majorant": "global"} for one in points if one["tracker"] == USUAL]
        self._round(0, [*self.had, *points, *self._global_only(points), *usual])
        best = self._few(TRACKERS, by=lambda one: next(iter(one.axes["tracker"])))
        self._round(
            1, [one.axes | {"majorant": m, "tightness": 1} for one in best for m in majorants]
        )
        self._round(2, [one.axes | {"tightness": t} for one in self._few(CASES) for t in TIGHTNESS])
        mine = sorted(filter(self.is_had, self.found.values()), key=lambda one: one.hope)
        last = [*mine[:FINALISTS], *self._few(FINALISTS if not self.renderer else 2)]
        self._round(3, [one.axes for one in {one.case.case: one for one in last}.values()])
        self._beyond(majorants)
        return self.finalists()

    def is_had(self, one: Finding) -> bool:
        """Whether the renderer has it; without one, all is had."""
        return not self.renderer or any(contains(one.axes, point) for point in self.had)

    def finalists(self) -> list[Finding]:
        """The best that is known of what is had, the fastest first; raises RunError if none is."""
        mine = sorted(filter(self.is_had, self.found.values()), key=lambda one: one.rank)
        if not mine or not mine[0].case.settled:
            what = f"that {self.renderer.title} has " if self.renderer else ""
            why = f"nothing {what}is known to reach {100 * self.accuracy:g} %"
            if mine:
                why = "the fastest is not known: of no case is the variance settled; give it more "
                why += "time by --budget"
            raise RunError(f"{why}; what was measured is in {self.folder}")
        return mine[:FINALISTS]

    def _beyond(self, majorants: Sequence[Any]) -> None:
        """Go on once where the fastest lies at the edge of the search."""
        best = self.finalists()[0]
        further = self._further(best.axes, majorants)
        if not further:
            return
        if self.renderer:
            self.had += further.values()
        self.edge = f"the fastest lay at the edge of the search: {', '.join(further)}"
        if not self._round(4, [best.axes, *further.values()]):
            self.edge += "; what lies beyond was not measured"
            return
        now = self.finalists()[0]
        beyond = any(contains(now.axes, point) for point in further.values())
        self.edge += (
            f"; beyond it {now.case.name} is faster, and what lies further was not measured"
            if beyond
            else "; one more was measured beyond, and is not faster"
        )

    def _further(self, axes: Axes, majorants: Sequence[Any]) -> dict[str, Axes]:
        """The next points beyond the edges at which a point lies, by what is at its edge there."""
        ((name, given),) = axes["tracker"].items()
        found = {}
        parameters = self.known.trackers[name].parameters
        steps = RATES if self.renderer else STEPS
        for key in (key for key, one in parameters.items() if one.unit == "length"):
            for place, factor, what in ((0, 0.5, "smallest"), (-1, 2.0, "largest")):
                if contains(given[key], float(steps[place] * self.side)):
                    tracker = {name: given | {key: factor * given[key]}}
                    found[f"the {what} {key}"] = axes | {"tracker": tracker}
        if self.renderer or "majorant" not in self.known.trackers[name].needs:
            return found
        *others, tree = majorants
        if axes["majorant"] == others[-1] != "global":
            cells = [2 * count for count in axes["majorant"]["grid"]["resolution"]]
            found["the finest grid"] = axes | {"majorant": {"grid": {"resolution": cells}}}
        if contains(axes["majorant"], tree) and tree["octree"]["resolution"] < FINEST_TREE:
            cells = 2 * tree["octree"]["resolution"]
            found["the finest octree"] = axes | {"majorant": {"octree": {"resolution": cells}}}
        if axes["tightness"] == TIGHTNESS[-1]:
            found["the largest tightness"] = axes | {"tightness": 2 * TIGHTNESS[-1]}
        return found

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
        volume = read_volume(Path(keys["file"]), keys.get("grid"), keys.get("raw"))
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
            for factor in STEPS if lengths else (1,):
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

    def _round(self, turn: int, points: Sequence[Axes]) -> int:
        """Measure cases, as many as the budget has room for; returns how many.

        Notes those that reach the accuracy, also where it is interrupted.
        """
        share = SHARES[turn] / sum(SHARES[turn:])
        allowed = max(0.0, self.budget_s - self.spent_s) * share
        fit = int(allowed / (LEAST_S + self.beside_s)) if turn else len(points)
        if fit < len(points):
            self.lacks.append(f"{WHAT[turn]}: {len(points) - fit} of {len(points)} cases")
        if not (points := points[:fit]):
            return 0
        seconds = max(LEAST_S, allowed / len(points) - self.beside_s)
        stop = PRECISION[turn] | {"at_most": f"{seconds:.3g} s"}
        config = self.folder / f"round-{turn + 1}.yaml"
        write(config, self.config_text(points, stop))
        before = self.clock.outside_s
        sweep = api.sweep(
            config,
            config.with_suffix(""),
            known=self.known,
            listener=self.listener,
            clock=self.clock,
        )
        self.dense = self.dense or self._density(sweep)
        try:
            worker.run(sweep, self.part, self.timeout_s)
        finally:
            rows = self._note_all(sweep)
            took = self.clock.outside_s - before
            self.spent_s += took
            self.beside_s = max(0.0, took / len(points) - seconds)
        if not self.found:
            raise RunError(self._why_none(rows, sweep.folder.folder))
        return len(points)

    def _note_all(self, sweep: Sweep) -> list[Row]:
        """Note the rows that a sweep has written."""
        if not sweep.folder.holds_rows:
            return []
        by_id = {case.case_id: case for case in sweep.cases}
        rows, rounds = read_result(sweep.folder.folder)
        self.measured += sum(row["status"] == "ok" for row in rows)
        for row in rows:
            old = self.found.get(row["case"])
            self.note(row, axes_of(by_id[row["case_id"]]))
            if old is None or self.found.get(row["case"]) is not old:
                own = [one for one in rounds if one["case_id"] == row["case_id"]]
                self.rows[row["case"]] = row, own
        return rows

    def _density(self, sweep: Sweep) -> str:
        """How dense the volume is along the rays of a sweep."""
        case = sweep.cases[0]
        scene = scenes_of([case], sweep.config.search_path)[case]
        return str(survey.density(scene.medium, scene.segments, self.side))

    def keep(self) -> None:
        """Write the last rows of every case into the folder itself, for `freepath report`."""
        if not self.rows:
            return
        rounds = sorted(self.folder.glob(f"round-*/{SUMMARY}"))
        folder = ResultFolder(self.folder)
        folder.open([])
        for row, own in self.rows.values():
            folder.append(row, own)
        folder.close()
        shutil.copy(rounds[-1].with_name(RUN), self.folder / RUN)

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
            "name: recommend",
            f"seed: {SEED}",
            f"rays: {as_yaml(RAYS)}",
            "matrix:",
            *(f"  {axis}: {as_yaml(value)}" for axis, value in matrix.items()),
            *(["include:"] if others else []),
            *(f"  - {as_yaml(point)}" for point in others),
            f"stop: {as_yaml(stop)}",
        ]
        return "\n".join(lines) + "\n"

    def write(self, finalists: Sequence[Finding]) -> Path:
        """Write the config that measures the finalists again, the best first."""
        path = self.folder / CONFIG
        text = self.config_text([one.axes for one in finalists], PRECISION[-1] | {"at_most": "5 s"})
        what = f"{self.estimand} to {100 * self.accuracy:g} %: the first case is the fastest"
        write(path, f"# {what}; the others came next.\n{text}")
        return path


def as_yaml(value: Any) -> str:
    """JSON that is YAML too, whose escapes know no halves of a letter."""
    return json.dumps(value, ensure_ascii=False)


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
    single = case.majorant is None or case.majorant.kind == "global"
    majorant = "global" if single else case.majorant.as_dict()
    tightness = 1 if case.tightness is None else case.tightness
    tracker = {case.tracker: dict(case.params)}
    return {"tracker": tracker, "majorant": majorant, "tightness": tightness}
