"""A new tracker on trial: which checks it must pass, whom it meets, and where it pays."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from freepath.checks import registry
from freepath.checks import session as checking
from freepath.checks.model import Check
from freepath.checks.outcome import SKIPPED, Outcome
from freepath.checks.rig import Rig
from freepath.checks.suite.common import everyone, homogeneous
from freepath.checks.verdict import NotApplicable
from freepath.compose import catalog as catalogs
from freepath.compose.catalog import Catalog, Tracker
from freepath.device.opencl import Device, DeviceInfo
from freepath.errors import CatalogError
from freepath.results.folder import CHECKS
from freepath.show.report.data import Report, known_to
from freepath.show.table import seconds

RELATIVES = 4
"""Trackers that a candidate is measured beside."""
TIMEOUT_S = 60.0
"""A fast check takes a second or two: one that takes this long hangs."""
CONFIG = "try.yaml"
SEED = 7
ATMOSPHERE = {"exponential": {"sigma_t": 5, "scale_height": 0.3}}
CLOUD = {"cloud": {"resolution": 64, "sigma_t": 20}}
PERIODIC = {"cosine": {"sigma_t": 2, "amplitude": 0.9, "periods": 3}}
STOP = {"error": "5%", "time_noise": "5%", "at_most": "0.3 s"}


def read(file: Path) -> tuple[Catalog, Tracker]:
    """The shipped trackers with the one of a file.

    Raises CatalogError for a name that is taken, front matter that is wrong, and estimands that no
    check knows the answer of.
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
    return known, tracker


def checks_of(known: Catalog, tracker: Tracker, *, every: bool) -> list[tuple[int, Check]]:
    """Those of a tracker with their numbers: the fast ones, or every one but those of minutes."""
    return [
        (number, check)
        for number, check in enumerate(registry.checks(known), 1)
        if tracker.name in check.labels and (every or "fast" in check.labels) and check.in_tests
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
) -> list[Outcome]:
    """Run checks of a tracker on a device, in processes of their own."""
    timeout = TIMEOUT_S if all("fast" in one.labels for _, one in chosen) else 5 * TIMEOUT_S
    options = checking.Options(parallel=processes, trackers=(file,), timeout=timeout)
    return checking.Session(chosen, options, tell).run(info)


def keep(outcomes: Sequence[Outcome], folder: Path) -> Path:
    """Write what became of each check into the folder, for the report and for scripts."""
    path = folder / CHECKS
    path.write_text(json.dumps([asdict(one) for one in outcomes], indent=1), encoding="utf-8")
    return path


def relatives(known: Catalog, tracker: Tracker) -> list[Tracker]:
    """The trackers most like it: that share estimands, and what they need and promise."""
    others = [
        other
        for other in known.trackers.values()
        if other.name != tracker.name and set(other.estimands) & set(tracker.estimands)
    ]
    return sorted(others, key=lambda other: -_likeness(tracker, other))[:RELATIVES]


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


def failed(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """The checks that it did not pass."""
    return [one for one in outcomes if one.wrong]


def passed(outcomes: Sequence[Outcome]) -> int:
    """How many it passed."""
    return sum(not one.wrong and one.status != SKIPPED for one in outcomes)


@dataclass(frozen=True)
class Standing:
    """The candidate's soonest case of a question beside the soonest of its relatives."""

    question: str
    own: dict[str, Any] | None
    other: dict[str, Any] | None

    def __str__(self) -> str:
        """One sentence."""
        if self.own and "t1" in self.own["unknown"]:
            return "not known: the variance of its scores is not settled"
        if self.own is None:
            return "never reaches 1 %: its bias is larger"
        mine = f"1 % after {seconds(self.own['t1'])} ({self.own['method']})"
        if self.other is None or "t1" in self.other["unknown"]:
            return f"pays: {mine}, and none of its relatives is known to reach it"
        factor = self.other["t1"] / self.own["t1"]
        noise = math.hypot(known_to(self.own, "t1"), known_to(self.other, "t1"))
        text = f"{mine}; {self.other['method']} after {seconds(self.other['t1'])}"
        if abs(math.log(factor)) <= noise:
            return f"pays nothing and costs nothing, within {100 * noise:.0f} %: {text}"
        if factor > 1:
            return f"pays: {factor:.2f} times as fast, known to {100 * noise:.0f} %: {text}"
        return f"does not pay: takes {1 / factor:.2f} times as long: {text}"


def standings(report: Report, tracker: Tracker) -> list[Standing]:
    """Where it stands, for each question that it was measured on."""
    found = []
    for question in report.values("q"):
        rows = [row for row in report.measured if row["q"] == question]
        own = [row for row in rows if row["tracker"] == tracker.name]
        if own:
            others = [row for row in rows if row["tracker"] != tracker.name]
            found.append(Standing(question, _soonest(own), _soonest(others)))
    return found


def _soonest(rows: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """The fastest that is known; else one that is not known, if it is there."""
    reaching = [row for row in rows if isinstance(row["t1"], float)]
    return min(reaching, key=lambda row: ("t1" in row["unknown"], row["t1"]), default=None)
