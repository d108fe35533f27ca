"""The two sides of a comparison, each a run or several runs of the same sweep."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from freepath.errors import FreepathError
from freepath.results.folder import RUN, SUMMARY, read_result
from freepath.results.reading import facts
from freepath.show.table import Row

Key = tuple[str, ...]
HOST = ("processor", "cores", "system")
"""What of run.json says that two results are from one machine."""


@dataclass
class Run:
    """One run: rows of cases, and the rounds of each, by identity (case_id, device, platform)."""

    rows: dict[Key, Row]
    times: dict[Key, dict[int, float]]
    """Seconds a sample by the number of the round; rounds of full size only."""
    variances: dict[Key, list[float]]
    host: dict[str, Any]
    effects: dict[Key, Any] | None = None
    """What timing.effects finds; kept, as it is asked for more than once."""


@dataclass
class Side:
    """A side of a comparison."""

    name: str
    runs: list[Run] = field(default_factory=list)

    @property
    def rows(self) -> dict[Key, Row]:
        """The row of each case, of the first run that measured it."""
        found: dict[Key, Row] = {}
        for run in self.runs:
            for key, row in run.rows.items():
                if key not in found or found[key]["status"] != "ok":
                    found[key] = row
        return found


def load(path: Path) -> Side:
    """Read the folder of a run, or one of several runs of a sweep, a folder each.

    Raises FreepathError where there is none, or where they are of another schema version.
    """
    folders = [path] if (path / SUMMARY).is_file() else []
    if not folders and path.is_dir():
        folders = sorted(p for p in path.iterdir() if (p / SUMMARY).is_file())
    if not folders:
        raise FreepathError(
            f"{path}: expected the folder of a run, with {SUMMARY} in it, or of several runs"
        )
    return Side(str(path), [run_of(folder) for folder in folders])


def run_of(folder: Path) -> Run:
    """The run in a folder, without cases that were skipped."""
    cases, rounds = read_result(folder)
    rows = {_key(row): row for row in cases if row["status"] != "skipped"}
    times: dict[Key, dict[int, float]] = defaultdict(dict)
    variances: dict[Key, list[float]] = defaultdict(list)
    sizes: dict[Key, str] = {}
    for row in rounds:
        key = _key(row)
        # the last rounds may be smaller, and what they take is not comparable
        if sizes.setdefault(key, row["samples"]) != row["samples"] or key not in rows:
            continue
        column = "time_wall_s" if rows[key]["timing_source"] == "wall" else "time_device_s"
        seconds = float(row[column]) / float(row["samples"])
        if seconds > 0:
            times[key][int(row["round"])] = seconds
        if row["variance"]:
            variances[key].append(float(row["variance"]))
    return Run(rows, times, variances, _host(folder))


def _key(row: Row) -> Key:
    return row["case_id"], row["device"], row["platform"]


def _host(folder: Path) -> dict[str, Any]:
    try:
        host = facts(folder / RUN)["sessions"][-1]["host"]
        return {name: host[name] for name in HOST}
    except (LookupError, TypeError):
        return {}


def refuse(reference: Side, contender: Side) -> str:
    """Why two sides should not be compared: they are from different machines; '' if they may be."""
    hosts = [run.host for side in (reference, contender) for run in side.runs]
    for name in HOST:
        found = sorted({str(host.get(name, "unknown")) for host in hosts})
        if len(found) > 1:
            return f"they are from different machines: {name} is {' and '.join(found)}"
    return ""


PAIRED = ("case_id", "device", "platform")
NAMED = ("estimand", "medium", "rays", "light", "tracker", "majorant", "tightness", "lanes", "seed")
NAMED += ("arithmetic", "storage", "params")


def unpaired(reference: Side, contender: Side) -> str:
    """Why no case of two sides pairs: what they have not in common; '' where some pair."""
    sides = [list(side.rows.values()) for side in (reference, contender)]
    if reference.rows.keys() & contender.rows.keys():
        return ""
    values = [{name: {row[name] for row in rows} for name in (*PAIRED, *NAMED)} for rows in sides]
    other = [name for name in values[0] if not values[0][name] & values[1][name]]
    other = [name for name in other if name != "case_id"] if "case_id" in other else other
    told = [
        f"{name} is {_listed(values[0][name])} and {_listed(values[1][name])}" for name in other
    ]
    why = "; ".join(told[:3]) or "their case_ids differ"
    return f"no case of one pairs with a case of the other: {why}"


def _listed(values: set[str]) -> str:
    first = sorted(values)[:2]
    return " or ".join(f"'{one}'" for one in first) + (", ..." if len(values) > 2 else "")


def on_device_of(reference: Side, contender: Side) -> Side:
    """The contender as if its device were the reference's, so that the cases of both pair.

    Raises FreepathError where a side has several devices.
    """
    places = [{key[1:] for run in side.runs for key in run.rows} for side in (reference, contender)]
    if any(len(found) != 1 for found in places):
        names = [" / ".join(place) for found in places for place in sorted(found)]
        raise FreepathError(f"expected a device on either side, got {', '.join(names)}")
    (place,) = places[0]

    def moved(found: dict[Key, Any]) -> dict[Key, Any]:
        return {(key[0], *place): value for key, value in found.items()}

    runs = [
        Run(moved(one.rows), moved(one.times), moved(one.variances), one.host)
        for one in contender.runs
    ]
    return Side(contender.name, runs)


def scenes(run: Run) -> dict[Key, list[Key]]:
    """The cases that were measured in turns: those of a medium and its rays on a device."""
    found: dict[Key, list[Key]] = defaultdict(list)
    for key, row in run.rows.items():
        if len(run.times.get(key, ())) > 1:
            place = row["device"], row["platform"], row["host"]
            found[(*place, row["medium"], row["rays"])].append(key)
    return found


def table_of(times: list[dict[int, float]]) -> np.ndarray:
    """Logarithms of times (cases, rounds); NaN where a case had ended."""
    last = 1 + max(max(one) for one in times)
    found = np.full((len(times), last), np.nan)
    for place, one in enumerate(times):
        found[place, list(one)] = np.log(list(one.values()))
    return found
