"""The table that `run` prints, from the rows of summary.csv."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from typing import Any

from rich.table import Table

Row = dict[str, str]
PREFIXES = ((1e-9, "n"), (1e-6, "u"), (1e-3, "m"), (1.0, ""))


def number(row: Row, column: str) -> float | None:
    """A column as a number; None where it is empty."""
    return float(row[column]) if row[column] else None


def seconds(value: float | None) -> str:
    """Seconds with a prefix and three digits."""
    if value is None:
        return ""
    if math.isinf(value):
        return "never"
    if value == 0:
        return "0 s"
    scale, prefix = next(
        (pair for pair in PREFIXES if value < 1000 * pair[0]), (1.0, "")
    )
    return f"{value / scale:.3g} {prefix}s"


def short(value: float | None, digits: int = 3) -> str:
    """A number with few digits, or nothing."""
    return "" if value is None else f"{value:.{digits}g}"


def by_device(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by the name of their device with its platform and driver."""
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        groups[f"{row['device']} ({row['platform']} {row['driver_version']})"].append(row)
    return groups


def group_key(row: Row) -> tuple[str, ...]:
    """Cases that answer the same question on the same device."""
    return tuple(row[column] for column in ("device", "estimand", "medium"))


def _interval(row: Row) -> tuple[float, float]:
    """The time to 1 % and the half-width of its interval, from the noise of the time alone."""
    value = number(row, "time_to_1pct_s")
    noise = number(row, "time_noise")
    return value, value * (1.0 if noise is None else noise)


def best_of(rows: Iterable[Row]) -> set[str]:
    """The case_ids that reach 1 % soonest in their group, ties within their intervals included."""
    groups: dict[tuple, list[Row]] = defaultdict(list)
    for row in rows:
        if row["status"] == "ok" and row["time_to_1pct_s"] not in ("", "inf"):
            groups[group_key(row)].append(row)
    best = set()
    for members in groups.values():
        first = min(members, key=lambda row: number(row, "time_to_1pct_s"))
        least, width = _interval(first)
        for row in members:
            value, other = _interval(row)
            if value - least <= math.hypot(width, other):
                best.add(row["case_id"])
    return best


def _bias(row: Row) -> str:
    """The bias relative to the reference, with the half-width of its 95 % interval if it has one."""
    bias, reference = number(row, "bias"), number(row, "reference")
    if bias is None or not reference:
        return ""
    width = 1.96 * (number(row, "bias_stderr") or 0.0)
    if not width:
        return f"{100 * bias / reference:+.1g}%"
    digits = max(0, 1 - math.floor(math.log10(100 * width / abs(reference))))
    return f"{100 * bias / reference:+.{digits}f}±{100 * width / abs(reference):.{digits}f}%"


def label(row: Row) -> str:
    """Tracker and majorant, with the parameters that are not their defaults."""
    tracker = row["case"].split("/")[-3]
    if row["majorant"] == "none":
        return tracker
    return f"{tracker} {row['majorant']} x{number(row, 'tightness'):g}"


def _cells(row: Row, best: set[str]) -> list[str]:
    variance, reference = number(row, "variance"), number(row, "reference")
    relative = variance / reference**2 if reference else None
    bias = _bias(row) if row["status"] == "ok" else f"[bold red]{row['status']}[/]"
    to_1pct = seconds(number(row, "time_to_1pct_s"))
    mark = "[bold green]*[/]" if row["case_id"] in best else " "
    return [
        _escape(label(row)),
        row["lanes"] if row["arithmetic"] == "strict" else f"{row['lanes']} {row['arithmetic']}",
        short(number(row, "lookups_per_sample")),
        seconds(number(row, "time_per_sample_s")),
        f"{100 * number(row, 'lane_occupancy'):.0f}%",
        short(relative),
        bias,
        f"{to_1pct} {mark}",
    ]


def _escape(text: str) -> str:
    return text.replace("[", r"\[")


def table_of(rows: list[Row]) -> Table:
    """A table of one group's measured rows; what reaches 1 % soonest is marked with a star."""
    first = rows[0]
    reference = next((short(number(row, "reference"), 4) for row in rows if row["reference"]), "?")
    title = f"{first['estimand']} of {first['medium']}, {first['rays']} rays, reference {reference}"
    table = Table(title=title, title_justify="left", title_style="bold", box=None, padding=(0, 1, 0, 0))
    table.add_column("tracker", overflow="fold")
    for name in ("lanes", "lookups", "time", "occ.", "rel. var.", "bias", "to 1%  "):
        table.add_column(name, justify="right", no_wrap=True)
    best = best_of(rows)
    for row in rows:
        table.add_row(*_cells(row, best))
    return table


def groups(rows: Iterable[Row]) -> list[list[Row]]:
    """The rows that have numbers, by group_key."""
    found: dict[tuple, list[Row]] = defaultdict(list)
    for row in rows:
        if row["estimate"] or row["status"] == "invalid":
            found[group_key(row)].append(row)
    return list(found.values())


LEGEND = (
    "time: device time a sample. occ.: lanes at work. rel. var.: variance of one sample over the\n"
    "squared reference. bias: of the reference, with its 95 % interval. to 1%: device time a ray\n"
    "for a relative RMSE of 1 %; * the soonest, ties within the noise of timing included."
)


def records(rows: list[Row]) -> list[dict[str, Any]]:
    """Rows with numbers as numbers and empty cells as None; inf stays a word, as JSON has none."""
    return [{column: _value(text) for column, text in row.items()} for row in rows]


def _value(text: str) -> Any:
    if text == "":
        return None
    try:
        value = float(text)
    except ValueError:
        return text
    return value if math.isfinite(value) else text
