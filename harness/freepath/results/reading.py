"""Reads the CSV of a run, and refuses what no run has written: with file, line and column."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import Any

from freepath.errors import FreepathError

SIGNED = frozenset(("seed", "estimate", "reference", "bias", "z_score"))
"""Numbers that may be below 0."""
ENDLESS = frozenset(("time_to_10pct_s", "time_to_1pct_s", "time_to_0.1pct_s"))
"""Numbers that may be infinite: `never`."""
MEASURED: tuple[str, ...] = (
    "rays",
    "time_per_sample_s",
    "lookups_per_sample",
    "lane_occupancy",
    "estimate",
)
MEASURED += ("bias_stderr", "variance")
"""What a case of the status `ok` has."""
OF_A_ROUND = ("round", "samples", "time_device_s", "time_wall_s")
"""What each round has."""
WHOLE = frozenset(("round", "samples", "rays", "rounds", "samples_per_ray"))
STATUSES: tuple[str, ...] = (
    "ok",
    "skipped",
    "invalid",
    "build_failed",
    "run_failed",
    "timeout",
    "crashed",
)
STATUSES += ("mismatch",)
CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")
LARGEST = 1e300
"""Of a cell; beyond it squares are no numbers."""
PARTS = 5
"""Of the name of a case, at least: estimand/medium/tracker/lanes/arithmetic."""


class Row(dict[str, str]):
    """A row with the line that it ends in."""

    line = 0


def rows(path: Path, columns: tuple[str, ...], texts: Collection[str], version: int) -> list[Row]:
    """All rows; one that was cut off at the end of the file, by a crash, is left out.

    Raises FreepathError for a file that cannot be read or has other columns, and for a cell that
    is no number where it must be one, out of range, missing, or would command a terminal.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise FreepathError(f"{path}: cannot be read: {error.strerror}") from error
    whole = text.endswith("\n")
    reader = csv.reader(io.StringIO(text, newline=""))
    found, counts = [], []
    try:
        if tuple(next(reader, ())) != columns:
            raise FreepathError(f"{path}: its columns are not those of schema version {version}")
        for cells in filter(None, reader):
            row = Row(zip(columns, cells, strict=False))
            row.line = reader.line_num
            found.append(row)
            counts.append(len(cells))
    except csv.Error as error:
        raise FreepathError(f"{path}:{reader.line_num}: cannot be read: {error}") from error
    if found and not whole:
        found.pop()
    for row, count in zip(found, counts, strict=False):
        if count != len(columns):
            wrong = "more" if count > len(columns) else "fewer"
            told = f"expected {len(columns)} cells, as the first line has, got {wrong}"
            raise FreepathError(f"{path}:{row.line}: {told}")
    for place, name in enumerate(columns, 1):
        _check(path, found, f"column {place}, {name}", name, _text if name in texts else _number)
    return found


def _check(
    path: Path, found: list[Row], where: str, name: str, wrong_of: Callable[[str, str], str]
) -> None:
    """Look at each text of a column once, and at each row only where that is not enough."""
    wrong = {text: wrong_of(name, text) for text in {row[name] for row in found}}
    if not any(wrong.values()) and "" not in wrong:
        return
    for row in found:
        if why := wrong[row[name]] or (not row[name] and _missing(row, name)):
            raise FreepathError(f"{path}:{row.line}: {where}: {why}")


def _missing(row: Row, name: str) -> str:
    """Why a cell must not be empty; '' where it may be."""
    if name in MEASURED and row.get("status") == "ok":
        return "expected a number, as the status is ok, got nothing"
    if name in OF_A_ROUND and "round" in row:
        return "expected a number, got nothing"
    if name == "tightness" and row["majorant"] != "none":
        return f"expected a number, as the majorant is {row['majorant']}, got nothing"
    return ""


def _text(name: str, text: str) -> str:
    """What is wrong with a text; '' where nothing is."""
    if CONTROL.search(text):
        return f"holds a control character: {text!r}"
    if name == "status" and text not in STATUSES:
        return f"expected one of {', '.join(STATUSES)}, got '{text}'"
    if name == "case" and text.count("/") < PARTS - 1:
        return f"expected estimand/medium/.../tracker/lanes/arithmetic, got '{text}'"
    return ""


def _number(name: str, text: str) -> str:
    if not text:
        return ""
    if name in WHOLE and not (text.isascii() and text.isdigit()):
        return f"expected a whole number, got {text!r}"
    try:
        value = math.nan if "_" in text else float(text)
    except ValueError:
        value = math.nan
    if value == math.inf and name in ENDLESS:
        return ""
    if not abs(value) < LARGEST:
        return f"expected a number, got {text!r}"
    if name == "time_per_sample_s" and value == 0.0:
        return f"expected a time above 0, got {text}"
    return f"expected 0 or more, got {text}" if value < 0.0 and name not in SIGNED else ""


def agree(summary: Path, cases: Iterable[Row], rounds: Iterable[Row], key: tuple[str, ...]) -> None:
    """Raise FreepathError where rounds do not reach what a summary says of them.

    `key` are the columns that a round and its case have in common.
    """
    found: dict[tuple[str, ...], dict[int, int]] = defaultdict(dict)
    for one in rounds:
        found[tuple(one[name] for name in key)][int(one["round"])] = int(one["samples"])
    for row in cases:
        if not row["rounds"] or not row["samples_per_ray"]:
            continue
        samples = found[tuple(row[name] for name in key)]
        told = int(row["rounds"]), int(row["samples_per_ray"]) * int(row["rays"])
        if told != (len(samples), sum(samples.values())) or max(samples, default=0) >= told[0]:
            raise FreepathError(
                f"{summary}:{row.line}: {row['case']}: expected {told[0]} rounds of {told[1]} "
                f"samples in all beside it, found {len(samples)} of {sum(samples.values())}: a "
                "file was cut or changed"
            )


def facts(path: Path) -> dict[str, Any]:
    """What run.json says; nothing where it is missing. Raises FreepathError where it is damaged."""
    try:
        found = json.loads(path.read_text("utf-8"), parse_constant=_refused)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as error:
        raise FreepathError(f"{path}: is not JSON that a run writes: {error}") from error
    if not isinstance(found, dict):
        raise FreepathError(f"{path}: expected an object, got {type(found).__name__}")
    return found


def _refused(word: str) -> Any:
    raise ValueError(f"{word} is no number of JSON")
