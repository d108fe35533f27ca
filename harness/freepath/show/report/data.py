"""What a report shows: the rows of one result or several, with what charts and tables need."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from freepath.errors import FreepathError, NothingMatchedError
from freepath.measure.ladder import Ladder
from freepath.results.folder import (
    CHECKS,
    CONFIRM,
    CONFIRM_COLUMNS,
    RUN,
    SUMMARY,
    read_result,
    read_rows,
)
from freepath.results.reading import facts
from freepath.show.answers import Case
from freepath.show.table import (
    ROUGH,
    Row,
    along,
    bias,
    bounces,
    lit,
    number,
    settled,
    uncertainty,
)

DEEPEST, HIGHEST = 1e-4, 10.0
"""Relative errors between which curves are drawn."""
LONGEST = 1e5
"""Curves end where the fastest case has run this often, unless all have met DEEPEST before."""
LADDER = {"t10": "time_to_10pct_s", "t1": "time_to_1pct_s", "t01": "time_to_0.1pct_s"}
COLOURS = 20
"""Trackers that colours tell apart; of more, only the names without parameters are told apart."""


@dataclass
class Report:
    """Records of measured cases and of confirmed predictions, and where they are from."""

    rows: list[dict[str, Any]] = field(default_factory=list)
    confirmed: list[dict[str, Any]] = field(default_factory=list)
    runs: list[dict[str, Any]] = field(default_factory=list)
    """Name and run.json of each result."""
    places: list[tuple[Path, dict[tuple[str, ...], dict[str, Any]]]] = field(default_factory=list)
    """The folder of each result, with its records by case_id, device and platform."""
    left_out: list[str] = field(default_factory=list)
    """Pictures that the page could not show, each with the reason."""

    @property
    def measured(self) -> list[dict[str, Any]]:
        """The records that curves can be drawn of."""
        return [row for row in self.rows if row["v"] is not None]

    def values(self, name: str) -> list[str]:
        """The different values of a field, in the order they come in."""
        return list(dict.fromkeys(row[name] for row in self.rows))


def load(results: Sequence[Path], only: str = "", question: str = "") -> Report:
    """Read results; raises FreepathError where one of them cannot be read.

    Of cases whose name matches the expression `only`, and questions that match `question`; raises
    NothingMatchedError where these leave none.
    """
    report = Report()
    given = [
        (name, path, [row for row in read_summary(path) if re.search(only, row["case"])])
        for name, path in _named(results)
    ]
    devices = _devices([(name, row) for name, _, rows in given for row in rows])
    for name, path, rows in given:
        methods = _variants(rows)
        records = {}
        for row in rows:
            record = _record(row, methods, devices[name, _device(row)])
            if not re.search(question, record["q"]):
                continue
            records[row["case_id"], row["device"], row["platform"]] = record
            report.rows.append(record)
        report.places.append((path, records))
        report.runs.append({"name": name, "checks": _checks(path)} | facts(path / RUN))
    if (only or question) and not report.rows:
        asked = f"'{only}' and '{question}'" if only and question else f"'{only or question}'"
        raise NothingMatchedError(f"no case of {results[0]} matches {asked}")
    for one in report.values("q"):
        _span([row for row in report.measured if row["q"] == one])
    for number_, row in enumerate(report.rows):
        row["id"] = number_
    labels = {row["label"] for row in report.rows}
    for row in report.rows:
        row["colour"] = row["label"] if len(labels) <= COLOURS else row["tracker"]
    for path, records in report.places:
        report.confirmed += _confirmed(path, records)
    return report


def _named(results: Sequence[Path]) -> list[tuple[str, Path]]:
    """Results by the names of their folders, told apart by their paths where these are the same."""
    names = [path.resolve().name for path in results]
    return [
        (name if names.count(name) == 1 else str(path), path)
        for name, path in zip(names, results, strict=True)
    ]


def read_summary(result: Path) -> list[Row]:
    """The rows of a result; raises FreepathError where the folder holds none."""
    summary = result / SUMMARY
    if not summary.is_file():
        raise FreepathError(f"{result}: expected the folder of a run, with {SUMMARY} in it")
    return read_result(result)[0]


def _checks(result: Path) -> list[dict[str, Any]]:
    """What became of the checks of a tracker on trial, where the result is of one."""
    try:
        found = json.loads((result / CHECKS).read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return []
    known = [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []
    return [one for one in known if {"name", "status", "text"} <= one.keys()]


def _device(row: Row) -> tuple[str, str, str, str]:
    return row["device"], row["platform"], row["driver_version"], row["host"]


def _devices(rows: list[tuple[str, Row]]) -> dict[tuple, str]:
    """A label for each device of each result, no longer than it takes to tell them apart."""
    found = dict.fromkeys((name, _device(row)) for name, row in rows)
    short = {key: key[1][0] for key in found}
    if len(set(short.values())) < len({device[:3] for _, device in found}):
        short = {key: f"{key[1][0]} ({key[1][1]} {key[1][2]})" for key in found}
    if len({device[3] for _, device in found}) > 1:
        short = {key: f"{label} on {key[1][3]}" for key, label in short.items()}
    if len(set(short.values())) < len(found):
        short = {key: f"{key[0]}: {label}" for key, label in short.items()}
    return short


def _variants(rows: list[Row]) -> list[tuple[str, str]]:
    """What cases differ in besides tracker and majorant, as columns with the words for them."""
    columns = (("lanes", "{} lanes"), ("arithmetic", "{}"), ("storage", "{} storage"))
    return [pair for pair in columns if len({row[pair[0]] for row in rows}) > 1]


def _record(row: Row, variants: list[tuple[str, str]], device: str) -> dict[str, Any]:
    """A row as charts and tables use it; errors and variances are relative to the reference."""
    words = [text.format(row[name]) for name, text in variants]
    label = ", ".join([row["tracker_label"], *along(row), *words])
    none = row["majorant"] == "none"
    tightness = None if none else number(row, "tightness")
    majorant = "none" if none else f"{row['majorant']} x{tightness:g}"
    record = {
        "q": _question(row, row["light"]),
        "scene": _question(row),
        "light": row["light"] if lit(row) else None,
        "device": device,
        "case": row["case"],
        "label": label,
        "tracker": row["tracker"],
        "majorant": majorant,
        "bound": row["majorant"],
        "method": label if none else f"{label}, {majorant}",
        "x": tightness,
        "lanes": row["lanes"],
        "arithmetic": row["arithmetic"],
        "storage": row["storage"],
        "status": row["status"],
        "reason": row["reason"],
        "bias_told": bias(row) if row["status"] == "ok" else "",
        "t": number(row, "time_per_sample_s"),
        "lookups": number(row, "lookups_per_sample"),
        "occupancy": number(row, "lane_occupancy"),
        "tn": number(row, "time_noise"),
        "vn": number(row, "variance_noise"),
    }
    record |= _errors(row) | {name: _time(row[column]) for name, column in LADDER.items()}
    rough = [name for name in LADDER if known_to(record, name) > ROUGH]
    unknown = [name for name in rough if not settled(known_to(record, name))]
    return record | {"rough": rough, "unknown": unknown}


def answered(record: dict[str, Any], name: str = "t1") -> Case | None:
    """A record as answers rank it; None where it does not reach the accuracy."""
    if record["v"] is None or not isinstance(record[name], float):
        return None
    parts = (record[one] for one in ("case", "tracker", "label", "bound", "x", name))
    return Case(*parts, known_to(record, name), record["b"])


def known_to(record: dict[str, Any], name: str) -> float:
    """Half the 95 % interval of a time of the ladder, relative to it; 0 where there is no time."""
    if not isinstance(record[name], float):
        return 0.0
    return uncertainty(record[name], record["t"], record["tn"], record["vn"])


def late(row: dict[str, Any]) -> float:
    """The time to 1 %; infinite where that is not known, or never."""
    known = isinstance(row["t1"], float) and "t1" not in row["unknown"]
    return row["t1"] if known else float("inf")


def _question(row: Row, *light: str) -> str:
    """What a row answers: only rows of one question are compared. Without a light: in any light."""
    told = [*light, bounces(row)] if lit(row) else []
    return ", ".join([row["estimand"], row["medium"], *told, f"{row['rays'] or '?'} rays"])


def _errors(row: Row) -> dict[str, float | None]:
    """Errors relative to the reference; where it is unknown, to the estimate, taken as unbiased."""
    reference, variance = number(row, "reference"), number(row, "variance")
    names = ("v", "b", "bias", "vt", "vl")
    known = reference is not None
    scale = abs((reference if known else number(row, "estimate")) or 0.0)
    if not scale or variance is None or row["status"] != "ok":
        return dict.fromkeys(names)
    mean, rms = (number(row, column) or 0.0 for column in ("bias", "bias_rms"))
    # the square of a small transmittance may be no number any more
    relative = math.sqrt(variance) / scale
    relative *= relative
    if not math.isfinite(relative):
        return dict.fromkeys(names)
    values = (
        relative,
        rms / scale,
        mean / scale if known else None,
        relative * number(row, "time_per_sample_s"),
        relative * number(row, "lookups_per_sample"),
    )
    return dict(zip(names, values, strict=True))


def _time(text: str) -> float | str | None:
    """Seconds; "never", as JSON has no infinity; None where unknown."""
    if not text:
        return None
    return float(text) if math.isfinite(float(text)) else "never"


def _span(rows: list[dict[str, Any]]) -> None:
    """Give rows of a question the times between which their curves are drawn, `lo` and `hi`."""
    if not rows:
        return
    starts = [row["t"] for row in rows]
    met = max(Ladder(0.0, row["v"], row["t"]).time_to(DEEPEST) for row in rows)
    low = min(starts)
    high = max(2 * max(starts), min(LONGEST * low, met))
    for row in rows:
        row |= {"lo": low, "hi": high}


def _confirmed(result: Path, records: dict[tuple, dict]) -> list[dict[str, Any]]:
    path = result / CONFIRM
    found = []
    for row in read_rows(path, CONFIRM_COLUMNS) if path.is_file() else []:
        record = records.get((row["case_id"], row["device"], row["platform"]))
        values = [number(row, f"rmse_{what}") for what in ("predicted", "measured", "low", "high")]
        predicted, measured, low, high = values
        reference = number(row, "reference")
        if record is None or None in values or not (predicted and measured and reference):
            continue
        shown = ("id", "q", "device", "method", "colour", "label", "tracker", "case")
        found.append(
            {name: record.get(name) for name in shown}
            | {
                "predicted": predicted / abs(reference),
                "ratio": measured / predicted,
                "low": low / predicted,
                "high": high / predicted,
                "samples": number(row, "samples_per_ray"),
                "time": number(row, "time_s"),
            }
        )
    return found
