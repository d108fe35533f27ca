"""A new tracker on trial: which checks it must pass, whom it meets, and where it pays."""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from freepath import api
from freepath.checks import registry
from freepath.checks import session as checking
from freepath.checks.model import Check
from freepath.checks.outcome import CRASHED, SKIPPED, TIMEOUT, Outcome
from freepath.checks.rig import Rig
from freepath.checks.suite.common import everyone, homogeneous
from freepath.checks.verdict import NotApplicable
from freepath.compose import catalog as catalogs
from freepath.compose.catalog import Catalog, Tracker
from freepath.device.opencl import Device, DeviceInfo
from freepath.device.selection import Part, first, one_device
from freepath.errors import CatalogError, expect
from freepath.extras.given import own_folder, volume_of
from freepath.measure import worker
from freepath.measure.sweep import Listener
from freepath.results.folder import CHECKS, new_folder, write
from freepath.show import answers, report, table
from freepath.show.report.text import sentences
from freepath.show.result import Result
from freepath.show.table import Row

RELATIVES = 4
"""Trackers that a candidate is measured beside."""
TIMEOUT_S = 60.0
"""A fast check takes a second or two: one that takes this long hangs."""
SMOKE_S = 10.0
"""The same of one with a few paths, where compiling took no time."""
HANGS = "{}: a step never ended a path: does it call escape or collide where the ray is left?"
INTERRUPTED = "interrupted"
CONFIG = "try.yaml"
SEED = 7
ATMOSPHERE = {"exponential": {"sigma_t": 5, "scale_height": 0.3}}
CLOUD = {"cloud": {"resolution": 64, "sigma_t": 20}}
PERIODIC = {"cosine": {"sigma_t": 2, "amplitude": 0.9, "periods": 3}}
STOP = {"error": "5%", "time_noise": "5%", "at_most": "0.3 s"}


def read(file: Path, like: str = "") -> tuple[Catalog, Tracker, Tracker]:
    """The shipped trackers with the one of a file, and its parent.

    That is `like`, else what its front matter calls so, else the one most like it.

    Raises CatalogError for a name that is taken, front matter that is wrong, estimands that no
    check knows the answer of, and a parent that is not there or estimates something else.
    """
    if not file.is_file():
        what = "a folder" if file.is_dir() else "nothing there"
        raise CatalogError(f"{file}: expected a tracker's .cl file, got {what}")
    if file.suffix != ".cl":
        raise CatalogError(f"{file}: expected a file whose name ends in .cl")
    known = catalogs.load([file])
    tracker = known.trackers[file.stem]
    if not everyone(tracker):
        raise CatalogError(
            f"{file}:1:1: estimands: expected transmittance or free_path among them, for these "
            f"have checks, got {', '.join(tracker.estimands)}"
        )
    fits = [other.name for other in relatives(known, tracker)]
    parent = like or tracker.like or fits[0]
    if parent not in fits:
        raise CatalogError(f"{file}: like: expected one of {', '.join(fits)}, got {parent}")
    return known, tracker, known.trackers[parent]


def checks_of(known: Catalog, tracker: Tracker, *, every: bool) -> list[tuple[int, Check]]:
    """Those of a tracker with their numbers: the fast ones, or every one but those of minutes."""
    return [
        (number, check)
        for number, check in enumerate(registry.checks(known), 1)
        if tracker.name in check.labels
        and (check.in_tests or (every and "minutes" not in check.labels))
    ]


def build(device: Device, known: Catalog, tracker: Tracker) -> None:
    """Compile it once, so that a slip of the pen is told once; raises BuildError with the log."""
    with tempfile.TemporaryDirectory(prefix="freepath-try-") as folder:
        rig = Rig(device, known, Path(folder))
        for estimand in tracker.estimands:
            if estimand in ("transmittance", "free_path"):
                try:
                    homogeneous(rig, tracker, 1.0, estimand=estimand)
                except NotApplicable:
                    continue


def check(
    chosen: Sequence[tuple[int, Check]],
    file: Path,
    info: DeviceInfo,
    processes: int,
    tell: Callable[[str], None],
    compiling_s: float = 0.0,
) -> tuple[list[Outcome], str]:
    """Run checks of a tracker on a device, in processes of their own: a few paths first.

    Returns what became of each, and why not all were run: it hangs, crashes, or was interrupted.
    """
    smoke = [one for one in chosen if "smoke" in one[1].labels]
    left = [one for one in chosen if one not in smoke]
    slow = TIMEOUT_S if all("fast" in one.labels for _, one in chosen) else 5 * TIMEOUT_S
    ended: list[Outcome] = []
    parts = [(smoke, round(SMOKE_S + 4 * compiling_s)), (left, slow)]
    for part, timeout in (one for one in parts if one[0]):
        options = checking.Options(parallel=processes, trackers=(file,), timeout=timeout)
        session = checking.Session(part, options, tell)
        try:
            session.run(info)
        except KeyboardInterrupt:
            return ended + session.outcomes.get(info.label, []), INTERRUPTED
        ended += session.outcomes.get(info.label, [])
        if part is smoke:
            for one in ended:
                if one.status in (TIMEOUT, CRASHED):
                    return ended, HANGS.format(one.text) if one.status == TIMEOUT else one.text
    return ended, ""


def keep(outcomes: Sequence[Outcome], folder: Path) -> Path:
    """Write what became of each check into the folder, for the report and for scripts."""
    path = folder / CHECKS
    write(path, json.dumps([asdict(one) for one in outcomes], indent=1))
    return path


def relatives(known: Catalog, tracker: Tracker) -> list[Tracker]:
    """Those that share an estimand, by how much alike they are in what they need and promise."""
    others = [
        other
        for other in known.trackers.values()
        if other.name != tracker.name and set(other.estimands) & set(tracker.estimands)
    ]
    return sorted(others, key=lambda other: (-_likeness(tracker, other), len(other.name)))


def _likeness(one: Tracker, other: Tracker) -> float:
    return (
        2.0 * _overlap(one.needs, other.needs)
        + _overlap(set(one.estimands), set(other.estimands))
        + (one.unbiased == other.unbiased)
        + (bool(one.bounding) == bool(other.bounding))
        - 0.5 * (one.channels != other.channels)
    )


def _overlap(one: set[str] | frozenset[str], other: set[str] | frozenset[str]) -> float:
    return len(one & other) / len(one | other) if one | other else 1.0


def sweep_text(tracker: Tracker, others: Sequence[Tracker], volume: dict[str, Any] | None) -> str:
    """The config of the sweep beside the relatives, in YAML (JSON is YAML)."""
    media: list[Any] = [ATMOSPHERE]
    media.append(PERIODIC if "closed_form" in tracker.needs else CLOUD)
    if volume:
        media.append({"volume": volume})
    majorants = [name for name in ("global", "grid") if name in tracker.majorants]
    shared = [name for name in ("transmittance", "free_path") if name in tracker.estimands]
    matrix = {
        "estimand": shared[0],
        "medium": media,
        "majorant": [{"grid": {"resolution": 8}} if m == "grid" else m for m in majorants],
        "tightness": [1, 4],
        "tracker": [tracker.name, *(other.name for other in others)],
    }
    lines = [
        f"# {tracker.name} beside its nearest relatives; run it again with",
        f"# freepath run {CONFIG} --trackers {tracker.path.name}",
        f"name: try-{tracker.name}",
        f"seed: {SEED}",
        "rays: {orthographic: {resolution: [32, 32], direction: [0.3, 0.2, 1]}}",
        "matrix:",
        *(f"  {axis}: {json.dumps(value)}" for axis, value in matrix.items()),
        f"stop: {json.dumps(STOP)}",
    ]
    return "\n".join(lines) + "\n"


def beside_parent(rows: Sequence[Row], name: str, parent: str) -> list[str]:
    """How many times as fast a tracker is as its parent to 1 %, at each majorant and tightness."""
    lines = []
    for group in table.groups(rows):
        lines.append(f"{group[0]['medium']}, beside {parent}:")
        at: dict[tuple[str, str], dict[str, Row]] = {}
        for row in group:
            of = at.setdefault((row["majorant"], row["tightness"]), {})
            of.setdefault(row["tracker"], row)
        for (majorant, tightness), of in sorted(at.items()):
            if name in of and parent in of:
                where = (
                    f"{majorant}, tightness {float(tightness):g}" if tightness else "no majorant"
                )
                own, other = answers.case_of(of[name]), answers.case_of(of[parent])
                lines.append(f"  {where}: {_in_words(own, other)}")
        if lines[-1].endswith(":"):
            lines.append("  no majorant and tightness that both were measured with")
    return lines


def _in_words(own: answers.Case | None, other: answers.Case | None) -> str:
    if own is None or other is None:
        return "it never reaches 1 %" if own is None else "only it reaches 1 %"
    if not (own.settled and other.settled):
        return "not known: the variance of its scores is not settled"
    low, high = answers.ratio(other, own)[1:]
    verdict = "faster" if low > 1 else "slower" if high < 1 else "no difference is known"
    return f"{answers.times_as_fast(other, own)}: {verdict}"


@dataclass
class Trial:
    """A tracker on trial: `check` says whether it is right, `measure` and `compare` where it pays.

    As a text it is what the command line says.
    """

    known: Catalog
    tracker: Tracker
    parent: Tracker
    part: Part
    folder: Path
    """Of its checks, its results and its report."""
    chosen: list[tuple[int, Check]]
    compiling_s: float
    volume: dict[str, Any] | None
    say: Callable[[str], None]
    lines: list[str] = field(default_factory=list)
    outcomes: list[Outcome] = field(default_factory=list)
    right: bool = False
    """Whether all checks were run and none failed."""
    interrupted: bool = False
    result: Result | None = None
    """What was measured beside its relatives, once that is done."""

    def tell(self, line: str) -> None:
        """Say it, and keep it."""
        self.lines.append(line)
        self.say(line)

    def check(self, tell: Callable[[str], None] = lambda text: None) -> None:
        """Run its checks; `tell` is called with how far they are."""
        processes, file = min(2, os.cpu_count() or 1), self.tracker.path
        info = self.part.infos[0]
        self.outcomes, stopped = check(self.chosen, file, info, processes, tell, self.compiling_s)
        kept = keep(self.outcomes, self.folder)
        wrong = [one for one in self.outcomes if one.wrong]
        passed = sum(not one.wrong and one.status != SKIPPED for one in self.outcomes)
        self.interrupted = stopped == INTERRUPTED
        self.right = not wrong and not stopped
        if stopped:
            self.tell(f"{stopped}; {len(self.outcomes)} checks were run")
        if not wrong:
            skipped = len(self.outcomes) - passed
            beside = f", {skipped} do not apply" if skipped else ""
            verdict = "none failed so far" if stopped else "right"
            self.tell(f"{verdict}: {passed} checks passed{beside}")
            return
        self.tell(f"wrong: {len(wrong)} of {len(self.outcomes)} checks failed")
        for one in wrong:
            text = one.text.strip().splitlines()
            self.tell(f"  {one.name}\n      {text[-1] if text else one.status}")
        self.tell(f"wrote {kept}; a wrong tracker is not measured")

    def measure(self, listener: Listener, timeout_s: float | None = None) -> None:
        """Measure it beside its parent and its relatives."""
        config = self.folder / CONFIG
        others = {one.name: one for one in (self.parent, *relatives(self.known, self.tracker))}
        few = list(others.values())[:RELATIVES]
        write(config, sweep_text(self.tracker, few, self.volume))
        sweep = api.sweep(config, self.folder, known=self.known, listener=listener)
        try:
            worker.run(sweep, self.part, timeout_s)
        except KeyboardInterrupt:
            where = f"its folder is {self.folder}, which `freepath report` shows"
            self.tell(f"interrupted with {sweep.ended} of {sweep.total} cases; {where}")
            self.interrupted = True
            return
        self.result = api.load(self.folder)

    @property
    def own_rows(self) -> list[Row]:
        """The rows of the tracker itself."""
        return [row for row in self.result.rows if row["tracker"] == self.tracker.name]

    def compare(self) -> None:
        """Write the report, and say where it pays."""
        found, page = report.write([self.folder], None, "html")
        pairs = beside_parent(self.result.rows, self.tracker.name, self.parent.name)
        for line in (*sentences(found), *pairs, f"wrote {page}"):
            self.tell(line)

    def __str__(self) -> str:
        """What the command line says."""
        return "\n".join(self.lines)

    __repr__ = __str__


def prepared(  # noqa: PLR0913 (what the command takes)
    file: Path,
    like: str = "",
    volume: Path | None = None,
    sigma_t: float | None = None,
    devices: Sequence[str] = (),
    output: Path | None = None,
    *,
    every: bool = False,
    say: Callable[[str], None] = lambda line: None,
) -> Trial:
    """Read and compile a tracker, and make the folder of its trial.

    Raises CatalogError as `read` does, BuildError with the compiler's log, UsageError for a folder
    that is neither empty nor of a trial.
    """
    known, tracker, parent = read(file, like)
    named = volume_of(volume, sigma_t)[1] if volume else None
    folder = output or new_folder(f"try-{tracker.name}")
    device, part = one_device(devices), first(devices)
    say(told := f"{tracker.title}, on {device.info.label}")
    started = time.monotonic()
    build(device, known, tracker)
    compiling_s = time.monotonic() - started
    own_folder(folder, "try")
    chosen = checks_of(known, tracker, every=every)
    trial = Trial(known, tracker, parent, part, folder, chosen, compiling_s, named, say, [told])
    which = "all" if every else "fast"
    trial.tell(f"{len(chosen)} checks ({which}) that its front matter calls for")
    return trial


def try_tracker(
    tracker: str | Path,
    *,
    devices: str | Sequence[str] = (),
    every_check: bool = False,
    checks_only: bool = False,
    **more: Any,
) -> Trial:
    """Check a tracker's file and measure it beside its parent, as `freepath try` does.

    `more` are like, volume, sigma_t and output: docs/try.md. Where a check fails nothing is
    measured and `right` is False. Raises FreepathError where it cannot be tried.
    """
    expect("tracker", isinstance(tracker, (str, Path)), "the path of a .cl file", tracker)
    for name in more:
        names = ("like", "volume", "sigma_t", "output")
        expect("try_tracker", name in names, f"arguments of {', '.join(names)}", name)
    paths = {name: Path(more[name]) for name in ("volume", "output") if more.get(name)}
    chosen = api.listed("devices", devices)
    trial = prepared(Path(tracker), devices=chosen, every=every_check, **more | paths)
    trial.check()
    if trial.right and not checks_only:
        trial.measure(Listener())
    if trial.result:
        trial.compare()
    return trial
