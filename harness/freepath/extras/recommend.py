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
from freepath.compose import catalog
from freepath.compose.catalog import ANY, Catalog
from freepath.device.selection import Part, first
from freepath.errors import NothingMatchedError, RunError, expect
from freepath.extras.given import own_folder, volume_of
from freepath.extras.renderers import RATES, RENDERERS, Renderer, contains
from freepath.measure import worker
from freepath.measure.jobs import scenes_of
from freepath.measure.sweep import Clock, Listener, Sweep
from freepath.results.folder import RUN, SUMMARY, ResultFolder, Row, new_folder, read_result, write
from freepath.scene import survey
from freepath.scene.volumes.reading import read_volume
from freepath.show import answers
from freepath.show.table import failures, number, seconds, settled, uncertainty

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
ESTIMANDS = ("transmittance", "free_path")
DEFAULT = "sigma_t is the default, 1: another may have another fastest; give yours by --sigma-t"
Axes = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Finding:
    """A case with its device seconds per ray to the accuracy asked for, and how to measure it."""

    case: answers.Case
    axes: Axes
    """Tracker, majorant and tightness as a config has them."""
    rough: bool = False
    """Whether its time alone is not known, as on a busy machine: measured longer it may be."""

    @property
    def rank(self) -> tuple[bool, float]:
        """By its time; what is not known comes behind all that is."""
        return not self.case.settled, self.case.time_s

    @property
    def hope(self) -> tuple[bool, float]:
        """By the lower end of its interval: what is known roughly is not given up for that.

        One whose time alone is not known stands by its middle, as its lower end may be 0.
        """
        less = self.case.noise if self.case.settled else 0.0
        return not (self.case.settled or self.rough), self.case.time_s * (1.0 - less)


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
    seed: int = SEED
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
        if again := self._in_doubt():
            self._round(4, [one.axes for one in again[:FINALISTS]])
        else:
            self._beyond(majorants)
        return self.finalists()

    def is_had(self, one: Finding) -> bool:
        """Whether the renderer has it; without one, all is had."""
        return not self.renderer or any(contains(one.axes, point) for point in self.had)

    def finalists(self) -> list[Finding]:
        """The best that is known of what is had, the fastest first; raises RunError if none is."""
        mine = self._ranked()
        if doubtful := self._in_doubt():
            one, best = doubtful[0].case, mine[0].case
            most = seconds(one.time_s * (1.0 + one.noise))
            why = f"{one.name} takes {most} at most, {best.name} {seconds(best.time_s)}"
            why += (
                f"; but the former is known to {100 * one.noise:.0f} % only, as on a busy machine"
            )
            raise RunError(f"the fastest is not known: {why}; give it more time by --budget")
        if not mine or not mine[0].case.settled:
            what = f"that {self.renderer.title} has " if self.renderer else ""
            why = f"nothing {what}is known to reach {100 * self.accuracy:g} %"
            if mine:
                why = "the fastest is not known: of no case is the variance settled; give it more "
                why += "time by --budget"
            raise RunError(f"{why}; what was measured is in {self.folder}")
        return mine[:FINALISTS]

    def _ranked(self) -> list[Finding]:
        return sorted(filter(self.is_had, self.found.values()), key=lambda one: one.rank)

    def _in_doubt(self) -> list[Finding]:
        """What is faster than the best that is known even at the end of its interval."""
        ranked = self._ranked()
        found = [
            one
            for one in ranked
            if one.rough and one.case.time_s * (1.0 + one.case.noise) < ranked[0].case.time_s
        ]
        return sorted(found, key=lambda one: one.hope)

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
        one = answers.at_accuracy(row, self.accuracy)
        old = self.found.get(row["case"])
        if one is None:
            self.found.pop(row["case"], None)
        elif one.settled or old is None or not old.case.settled:
            per_sample, noise = number(row, "time_per_sample_s"), number(row, "variance_noise")
            rough = not one.settled and settled(uncertainty(one.time_s, per_sample, 0.0, noise))
            self.found[row["case"]] = Finding(one, axes, rough)

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

    def told(self, finalists: Sequence[Finding], baseline: str) -> list[str]:
        """The sentence, what a renderer is to be told, and what the search took and lacks."""
        mine = [one.case for one in self.found.values() if self.is_had(one)]
        lines = [answers.sentence(mine, self.accuracy, baseline)]
        if self.renderer:
            lines += _told_for(self.renderer, finalists[0], self)
        lines.append(self.edge)
        if self.lacks or self.spent_s > OVER * self.budget_s:
            lacks = "; ".join(self.lacks) or "no case can be given less than 0.05 s"
            took = f"{self.spent_s:.1f} s were taken; not measured: {lacks}"
            lines.append(f"the budget of {self.budget_s:g} s was too little: {took}")
        took = f"{self.clock.outside_s:.0f} s, and {self.clock.build_s:.0f} s of compilation"
        return [*lines, f"{self.measured} cases measured in {took}"]

    def config_text(self, points: Sequence[Axes], stop: Axes) -> str:
        """A config of these cases, in YAML (JSON is YAML)."""
        first, *others = (dict(point) for point in points)
        matrix = {"estimand": self.estimand, "medium": [self.medium], **first}
        lines = [
            "name: recommend",
            f"seed: {self.seed}",
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


@dataclasses.dataclass(frozen=True)
class Recommendation:
    """What a search has found; as a text it is what the command line says."""

    folder: Path
    """Of its results, which `freepath.load` and `freepath report` take."""
    finalists: list[answers.Case]
    """The fastest first."""
    lines: list[str]
    config: Path | None
    """What measures the finalists again."""
    interrupted: bool = False
    """Whether Ctrl-C ended the search: then this is what was known."""

    @property
    def best(self) -> answers.Case:
        """The fastest; raises RunError where the search was interrupted before one was known."""
        if not self.finalists:
            raise RunError(str(self))
        return self.finalists[0]

    def __str__(self) -> str:
        """What the command line says."""
        return "\n".join(self.lines)

    __repr__ = __str__


def recommend(  # noqa: PLR0913 (what the command takes; all but the volume has a default)
    volume: str | Path,
    *,
    accuracy: float = 0.01,
    sigma_t: float | None = None,
    estimand: str = "transmittance",
    renderer: str | None = None,
    grid: str | None = None,
    budget: float = 30.0,
    output: str | Path | None = None,
    include: str = "",
    baseline: str = "",
    devices: str | Sequence[str] = (),
    trackers: Sequence[Path] = (),
    seed: int = SEED,
    raw: str | None = None,
    timeout_s: float | None = None,
    listener: Listener | None = None,
) -> Recommendation:
    """Find the tracker and majorant that reach an accuracy first in a volume.

    As `freepath recommend` does (docs/recommend.md): `accuracy` is a relative RMSE, `budget`
    seconds of measuring, `renderer` what --for takes, `include` a regular expression for names of
    trackers, `output` a folder that is empty or was made by this. Raises FreepathError with the
    message that the command line prints, and where nothing is known to reach the accuracy.
    """
    expect("volume", isinstance(volume, (str, Path)), "the path of a volume", volume)
    fits = isinstance(accuracy, (int, float)) and 1e-6 <= accuracy < 1
    expect("accuracy", fits, "a relative RMSE such as 0.01, from 1e-6 to below 1", accuracy)
    for name, value in (("budget", budget), ("sigma_t", 1.0 if sigma_t is None else sigma_t)):
        fits = isinstance(value, (int, float)) and 0 < value < 1e30
        expect(name, fits, "a number above 0", value)
    expect("estimand", estimand in ESTIMANDS, f"one of {', '.join(ESTIMANDS)}", estimand)
    known_renderers = (None, *RENDERERS)
    expect("renderer", renderer in known_renderers, f"one of {', '.join(RENDERERS)}", renderer)
    clock, volume = Clock(), Path(volume)
    medium = {"volume": volume_of(volume, sigma_t, grid=grid, raw=raw)[1]}
    known = catalog.load(trackers)
    part = first(api.listed("devices", devices))
    folder = Path(output) if output else new_folder(f"recommend-{volume.stem[:60]}")
    own_folder(folder, "recommend")
    asked = (medium, estimand, accuracy, budget, listener or Listener(), clock, include)
    search = Search(known, part, folder, *asked, RENDERERS.get(renderer or ""), seed, timeout_s)
    interrupted = False
    try:
        search.run()
    except KeyboardInterrupt:
        interrupted = True
    finally:
        search.keep()
    what = f"{estimand} to {100 * accuracy:g} %, on {part.infos[0].label}"
    lines = ["interrupted; what is known so far:"] if interrupted else []
    lines += [f"{volume.name}, {what}", search.dense, DEFAULT if sigma_t is None else ""]
    try:
        finalists = search.finalists()
    except RunError as error:
        if not interrupted:
            raise
        return Recommendation(folder, [], [*filter(None, lines), str(error)], None, True)
    config = search.write(finalists)
    lines += [*told_of(finalists, search.side), *search.told(finalists, baseline)]
    lines.append(f"wrote {config}; to look at all of it: freepath report {folder}")
    cases = [one.case for one in finalists]
    return Recommendation(folder, cases, [*filter(None, lines)], config, interrupted)


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


def told_of(finalists: Sequence[Finding], side: float) -> list[str]:
    """The best, how sure that is, and what the others take; a voxel's side is in the world."""
    best, *others = (one.case for one in finalists)
    low, high = (best.time_s * max(0.0, 1 + sign * best.noise) for sign in (-1, 1))
    lines = [
        f"fastest: {best.case}",
        f"  {seconds(best.time_s)} of device time per ray "
        f"(95 %: {seconds(low)} to {seconds(high)})",
    ]
    if step := next(iter(finalists[0].axes["tracker"].values())).get("step"):
        lines.append(f"  its step: {step / side:.3g} x a voxel, {step:.4g} in units of the scene")
    for place, one in enumerate(others):
        what = "second" if place == 0 else "then"
        middle, low, high = map(answers.digits, answers.ratio(one, best))
        times = f"{middle} ({low} to {high}) times as long" if one.settled else "not known"
        lines += [f"{what}: {one.case}", f"  {seconds(one.time_s)}, {times}"]
    return lines


def _told_for(renderer: Renderer, best: Finding, search: Search) -> list[str]:
    """What to set in a renderer, how biased that is, and what it costs not to have the rest."""
    bias = f"it is biased by {100 * best.case.bias:.1g} %"
    known = [one.case for one in search.found.values() if one.case.settled]
    fastest = min(known, key=lambda one: one.time_s)
    gain = "nothing that was measured is faster"
    if fastest is not best.case:
        gain = f"{fastest.name} would be {answers.times_as_fast(best.case, fastest)}"
    return [
        f"in {renderer.title}: {renderer.settings(best.axes, search.side)}",
        f"  {bias if best.case.biased else 'it has no measurable bias'}; of what it lacks: {gain}",
        f"  settings from {renderer.source}",
    ]
