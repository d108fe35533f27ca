"""The table that `run` prints, from the rows of summary.csv."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence

from rich.markup import escape
from rich.table import Table

Row = dict[str, str]
PREFIXES = ((1e-12, "p"), (1e-9, "n"), (1e-6, "u"), (1e-3, "m"), (1.0, ""))
ROUGH = 0.2
"""A time to an accuracy of which half the 95 % interval is more, relative to it, is marked."""
CLOSE = 0.1
"""A prediction that is no further from the measurement, relative to it, holds."""
FAILED = ("invalid", "build_failed", "run_failed", "timeout", "crashed", "mismatch")
"""Statuses of cases that went wrong."""
LEGEND = (
    "time: device time a sample. occ.: lanes at work. rel. var.: variance of one sample over the\n"
    "squared reference. bias: of the reference, with its 95 % interval. to 1%: device time a ray\n"
    "for a relative RMSE of 1 %, ~ if it is not known to 20 %; * the soonest, and what is not\n"
    "significantly later. Without a reference (?) the estimate stands in for it."
)


def number(row: Row, column: str) -> float | None:
    """A column as a number; None where it is empty."""
    return float(row[column]) if row[column] else None


def seconds(value: float | None) -> str:
    """Seconds with a prefix and three digits; "never" for infinity, nothing for None."""
    if value is None:
        return ""
    if math.isinf(value):
        return "never"
    scale, prefix = next((pair for pair in PREFIXES if value < 999.5 * pair[0]), PREFIXES[-1])
    return f"{value / scale:.3g} {prefix}s"


def short(value: float | None, digits: int = 3) -> str:
    """A number with few digits, or nothing."""
    return "" if value is None else f"{value:.{digits}g}"


def markdown_text(text: str) -> str:
    """A text that Markdown shows as it is, in a line."""
    special = {c: f"\\{c}" for c in "\\`*_[]<>|#"} | {"\n": " ", "\r": " "}
    return text.translate(str.maketrans(special))


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """The lines of a table of Markdown."""
    lines = (" | ".join(map(markdown_text, row)) for row in (header, *rows))
    first, *others = (f"| {line} |" for line in lines)
    return [first, "|" + " --- |" * len(header), *others]


def by_device(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by the name of their device with its platform and driver."""
    found: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        found[f"{row['device']} ({row['platform']} {row['driver_version']})"].append(row)
    return found


def group_key(row: Row) -> tuple[str, ...]:
    """Cases that answer the same question on the same device."""
    columns = ("device", "platform", "driver_version", "estimand", "medium", "rays")
    columns += ("light", "scatterings")
    return tuple(row[column] for column in columns)


def groups(rows: Iterable[Row]) -> list[list[Row]]:
    """The rows that were to run, by group_key."""
    found: dict[tuple, list[Row]] = defaultdict(list)
    for row in rows:
        if row["status"] != "skipped":
            found[group_key(row)].append(row)
    return list(found.values())


def failures(rows: Iterable[Row]) -> list[Row]:
    """The rows of cases that went wrong."""
    return [row for row in rows if row["status"] in FAILED]


def skipped(rows: Iterable[Row]) -> dict[str, int]:
    """How many cases were skipped for each reason."""
    return Counter(row["reason"] for row in rows if row["status"] == "skipped")


def tracker_label(row: Row) -> str:
    """The tracker with its parameters that are not their defaults, from the name of the case.

    That name is estimand/medium[/majorant/tightness]/tracker/lanes/arithmetic.
    """
    return row["case"].split("/")[-3]


def uncertainty(
    time: float, per_sample: float, time_noise: float | None, variance_noise: float | None
) -> float:
    """Half the 95 % interval of a time to an accuracy, relative to it.

    It is variance x time of a sample over a constant; in that of one sample, the least, there is no
    variance. The noises are relative too; one that is not known (None) is taken for the whole.
    """
    noises = [time_noise] if time <= per_sample else [time_noise, variance_noise]
    return math.hypot(*(1.0 if noise is None else noise for noise in noises))


def soonest(times: Sequence[tuple[float, float]]) -> list[int]:
    """The places of the least of (time, its uncertainty), and of those not significantly later.

    In the order of times, the least first.
    """
    order = sorted(range(len(times)), key=lambda place: times[place])
    widths = [time * relative for time, relative in times]
    return [
        place
        for place in order
        if times[place][0] - times[order[0]][0] <= math.hypot(widths[place], widths[order[0]])
    ]


def marked(value: float | None, uncertain: float) -> str:
    """A time to an accuracy, with "~" if it is known roughly."""
    finite = value is not None and math.isfinite(value)
    return ("~" if finite and uncertain > ROUGH else "") + seconds(value)


def _time_to_1pct(row: Row) -> tuple[float, float]:
    """The time to 1 % and half its 95 % interval, relative to it."""
    columns = ("time_to_1pct_s", "time_per_sample_s", "time_noise", "variance_noise")
    value, *others = (number(row, column) for column in columns)
    return value, uncertainty(value, *others)


def best_of(rows: Iterable[Row]) -> list[Row]:
    """The rows of a group that reach 1 % soonest, and those not significantly later."""
    finite = [r for r in rows if r["status"] == "ok" and r["time_to_1pct_s"] not in ("", "inf")]
    places = soonest([_time_to_1pct(row) for row in finite])
    return [finite[place] for place in sorted(places)]


def bias(row: Row) -> str:
    """The bias relative to the reference, with half its 95 % interval if it has one."""
    value, reference = number(row, "bias"), number(row, "reference")
    if value is None or not reference:
        return ""
    percent, width = (100 * x / abs(reference) for x in (value, 1.96 * number(row, "bias_stderr")))
    if not width:
        return f"{percent:+.1g}%"
    digits = max(0, 1 - math.floor(math.log10(width)))
    if digits > 4 or abs(percent) >= 1e4 or width >= 1e4:
        return f"{percent:+.1g}±{width:.1g}%"
    return f"{percent:+.{digits}f}±{width:.{digits}f}%"


def _method(row: Row) -> str:
    """Tracker, majorant and tightness."""
    parts = [tracker_label(row)]
    if row["majorant"] != "none":
        parts.append(f"{row['majorant']} x{number(row, 'tightness'):g}")
    return " ".join([*parts, *along(row)])


def along(row: Row) -> list[str]:
    """How paths are absorbed, shadow rays followed, and what is compiled, where a case says so."""
    usual = row["p_absorb"] in ("", "none", "auto")
    parts = [] if usual else [f"p_absorb {row['p_absorb']}"]
    parts += [] if row["shadow"] in ("", "none") else [f"shadow {row['shadow']}"]
    return parts + (["all effects"] if row["composition"] == "all" else [])


def _lanes(row: Row) -> str:
    """Lanes, with arithmetic and storage where these are not what they usually are."""
    unusual = [row["arithmetic"]] if row["arithmetic"] != "strict" else []
    unusual += [row["storage"]] if row["storage"] not in ("", "float") else []
    return " ".join([row["lanes"], *unusual])


def _ladder_cell(row: Row) -> str:
    return marked(*_time_to_1pct(row)) if row["time_to_1pct_s"] else ""


def _cells(row: Row, *, best: bool) -> list[str]:
    lanes = _lanes(row)
    if row["status"] != "ok":
        status = f"[bold red]{escape(row['status'])}[/]"
        return [escape(_method(row)), lanes, *[""] * 4, status, ""]
    variance, reference = number(row, "variance"), number(row, "reference")
    reference = number(row, "estimate") if reference is None else reference
    return [
        escape(_method(row)),
        lanes,
        short(number(row, "lookups_per_sample")),
        seconds(number(row, "time_per_sample_s")),
        f"{100 * number(row, 'lane_occupancy'):.0f}%",
        short(variance / reference**2 if reference else None),
        bias(row),
        _ladder_cell(row) + (" [bold green]*[/]" if best else "  "),
    ]


def lit(row: Row) -> bool:
    """Whether a case follows paths, in whatever light; of other cases it is none."""
    return row["light"] not in ("", "none")


def bounces(row: Row) -> str:
    """How many scatterings are followed."""
    count = row["scatterings"]
    return f"{count} scattering" if count == "1" else f"{count} scatterings"


def off(row: Row) -> float:
    """How far a row's prediction of confirm.csv is from what was measured, relative to that."""
    predicted, measured = (number(row, f"rmse_{what}") for what in ("predicted", "measured"))
    if predicted is None:
        return math.inf
    return abs(predicted / measured - 1.0) if measured else math.inf if predicted else 0.0


def confirmed(rows: Iterable[Row]) -> str:
    """How many cases predicted their error at all sample counts, by the rows of confirm.csv."""
    cases: dict[tuple[str, ...], list[Row]] = defaultdict(list)
    for row in rows:
        cases[row["device"], row["platform"], row["case_id"]].append(row)
    wide = [one for one in cases.values() if not all(map(_settled, one))]
    good = [one for one in cases.values() if max(map(off, one)) <= CLOSE]
    return (
        f"prediction within {100 * CLOSE:.0f} % for {len(good)} of {len(cases)} cases; "
        f"of {len(wide)} the measured error itself is not known to {100 * CLOSE:.0f} %"
    )


def _settled(row: Row) -> bool:
    """Whether the interval of the measured error is narrow enough to judge a prediction by."""
    low, measured, high = (number(row, f"rmse_{what}") for what in ("low", "measured", "high"))
    return high - measured <= CLOSE * measured and measured - low <= CLOSE * measured


def table_of(rows: list[Row]) -> Table:
    """A table of one group's rows; what reaches 1 % soonest is marked with a star."""
    first = rows[0]
    reference = next((short(number(row, "reference"), 4) for row in rows if row["reference"]), "?")
    rays = "1 ray" if first["rays"] == "1" else f"{first['rays']} rays"
    light = f" in {first['light']}, {bounces(first)}" if lit(first) else ""
    title = f"{first['estimand']} of {first['medium']}{light}, {rays}, reference {reference}"
    table = Table(title=escape(title), title_justify="left", title_style="bold", box=None)
    table.padding = (0, 1, 0, 0)
    table.add_column("tracker", overflow="fold")
    for name in ("lanes", "lookups", "time", "occ.", "rel. var.", "bias", "to 1%  "):
        table.add_column(name, justify="right", no_wrap=True)
    best = best_of(rows)
    for row in rows:
        table.add_row(*_cells(row, best=row in best))
    return table
