"""The table that `run` prints, from the rows of summary.csv."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence

from rich.markup import escape
from rich.table import Table

Row = dict[str, str]
PREFIXES = ((1e-12, "p"), (1e-9, "n"), (1e-6, "u"), (1e-3, "m"), (1.0, ""))
ROUGH = 0.2
"""A time to an accuracy of which half the 95 % interval is more, relative to it, is marked."""
UNSETTLED = 0.5
"""And one of which it is more is not known: its interval is threefold wide, or holds 0. Such a case
is ranked behind all others, and is never the fastest."""
COUNTED = 10_000
"""Lookups counted over fewer samples are marked: 1 % of noise, if they vary as much as they are."""
NARROW = 100
"""Columns of a terminal below which a table leaves out what explains times."""
CLOSE = 0.1
"""A prediction that is no further from the measurement, relative to it, holds."""
FAILED = ("invalid", "build_failed", "run_failed", "timeout", "crashed", "mismatch")
"""Statuses of cases that went wrong."""
LEGEND = (
    "time: device time per sample. occ.: lanes at work. rel. var.: variance of one sample over "
    "the squared reference. bias: mean over rays with its 95 % interval; in brackets the RMS over "
    "rays, which decides, where it is more. to 1%: device time per ray to a relative RMSE of 1 %; "
    "~ if it is not known to 20 %, ? if it is not known, never if the RMS of the bias is larger; "
    "* the fastest, and what is not significantly slower. lookups: ~ if counted over few samples. "
    "Without a reference (?) the estimate stands in for it. Words: freepath explain WORD, "
    "docs/glossary.md."
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


def by_device(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by the name of their device with its platform and driver, and host if of several."""
    rows, found = list(rows), defaultdict(list)
    several = len({row["host"] for row in rows}) > 1
    for row in rows:
        where = f" on {row['host']}" if several else ""
        found[f"{row['device']} ({row['platform']} {row['driver_version']}){where}"].append(row)
    return found


def group_key(row: Row) -> tuple[str, ...]:
    """Cases that answer the same question on the same device."""
    columns = ("device", "platform", "driver_version", "host", "estimand", "medium", "rays")
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


def uncertainty(
    time: float, per_sample: float, time_noise: float | None, variance_noise: float | None
) -> float:
    """Half the 95 % interval of a time to an accuracy, relative to it.

    It is variance x time of a sample over a constant; in that of one sample, the least, there is no
    variance. The noises are relative too; one that is not known (None) is taken for the whole.
    """
    noises = [time_noise] if time <= per_sample else [time_noise, variance_noise]
    return math.hypot(*(1.0 if noise is None else noise for noise in noises))


def settled(uncertain: float) -> bool:
    """Whether a time that is known to so much (half its 95 % interval, relative) can be ranked."""
    return uncertain <= UNSETTLED


def soonest(times: Sequence[tuple[float, float]]) -> list[int]:
    """The places of the least of (time, its uncertainty), and of those not significantly later.

    In the order of times, the least first. Of those that are settled: what is not known is neither
    the least nor as good as it.
    """
    order = [place for place in range(len(times)) if settled(times[place][1])]
    order.sort(key=lambda place: times[place])
    widths = [time * relative for time, relative in times]
    return [
        place
        for place in order
        if times[place][0] - times[order[0]][0] <= math.hypot(widths[place], widths[order[0]])
    ]


def marked(value: float | None, uncertain: float) -> str:
    """A time to an accuracy, with "~" if it is known roughly, "?" if it is not known."""
    if value is None or math.isinf(value):
        return seconds(value)
    return ("" if uncertain <= ROUGH else "~" if settled(uncertain) else "?") + seconds(value)


def _time_to_1pct(row: Row) -> tuple[float, float]:
    """The time to 1 % and half its 95 % interval, relative to it."""
    columns = ("time_to_1pct_s", "time_per_sample_s", "time_noise", "variance_noise")
    value, *others = (number(row, column) for column in columns)
    return value, uncertainty(value, *others)


def best_of(rows: Iterable[Row]) -> list[Row]:
    """The rows of a group that reach 1 % first, and those not significantly later."""
    finite = [r for r in rows if r["status"] == "ok" and r["time_to_1pct_s"] not in ("", "inf")]
    places = soonest([_time_to_1pct(row) for row in finite])
    return [finite[place] for place in sorted(places)]


def bias(row: Row) -> str:
    """The mean bias relative to the reference, with half its 95 % interval if it has one.

    Behind it in brackets its RMS over rays, which decides whether an accuracy is reached; nothing
    where noise explains that.
    """
    value, reference = number(row, "bias"), number(row, "reference")
    if value is None or not reference:
        return ""
    percent, width = (100 * x / abs(reference) for x in (value, 1.96 * number(row, "bias_stderr")))
    rms = 100 * (number(row, "bias_rms") or 0.0) / abs(reference)
    told = f" ({rms:.1g}%)" if rms > 1.05 * abs(percent) else ""
    if not width:
        return f"{percent:+.1g}%{told}"
    digits = max(0, 1 - math.floor(math.log10(width)))
    if digits > 4 or abs(percent) >= 1e4 or width >= 1e4:
        return f"{percent:+.1g}±{width:.1g}%{told}"
    return f"{percent:+.{digits}f}±{width:.{digits}f}%{told}"


def _method(row: Row) -> str:
    """Tracker, majorant and tightness."""
    parts = [row["tracker_label"]]
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


def _cells(row: Row, *, best: bool) -> dict[str, str]:
    """By the name of the column."""
    named = {"tracker": escape(_method(row)), "lanes": _lanes(row)}
    if row["status"] != "ok":
        return named | {"bias (RMS)": f"[bold red]{escape(row['status'])}[/]"}
    variance, reference = number(row, "variance"), number(row, "reference")
    reference = number(row, "estimate") if reference is None else reference
    few = (number(row, "counted_samples") or COUNTED) < COUNTED
    root = math.sqrt(variance) / reference if reference else 0.0
    return named | {
        "lookups": "~" * few + short(number(row, "lookups_per_sample")),
        "time": seconds(number(row, "time_per_sample_s")),
        "occ.": f"{100 * number(row, 'lane_occupancy'):.0f}%",
        "rel. var.": short(root * root) if reference else "",
        "bias (RMS)": bias(row),
        "to 1%  ": _ladder_cell(row) + (" [bold green]*[/]" if best else "  "),
    }


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


def rank(row: Row) -> tuple[int, float]:
    """The fastest to 1 % first; then what is not known, what never gets there, and what failed."""
    if row["status"] != "ok":
        return 4, 0.0
    if not row["time_to_1pct_s"]:
        return 3, 0.0
    time, uncertain = _time_to_1pct(row)
    return 2 if math.isinf(time) else 0 if settled(uncertain) else 1, time


def table_of(
    rows: list[Row], ratio: Callable[[Row], str] | None = None, width: int = NARROW
) -> Table:
    """A table of one group's rows, the fastest first; what reaches 1 % first has a star.

    `ratio` says how many times as fast as the baseline a row is. Lanes are a column where they
    differ, else in the title.
    """
    first = rows[0]
    reference = next((short(number(row, "reference"), 4) for row in rows if row["reference"]), "?")
    rays = "1 ray" if first["rays"] == "1" else f"{first['rays']} rays"
    light = f" in {first['light']}, {bounces(first)}" if lit(first) else ""
    title = f"{first['estimand']} of {first['medium']}{light}, {rays}, reference {reference}"
    alike = len({_lanes(row) for row in rows}) == 1
    title += f", {_lanes(first)} lanes" if alike else ""
    table = Table(title=escape(title), title_justify="left", title_style="bold", box=None)
    table.padding, table.min_width = (0, 1, 0, 0), min(width, len(title))
    names = ["tracker", "lanes", "lookups", "time", "occ.", "rel. var.", "bias (RMS)", "to 1%  "]
    left_out = {"lanes"} if alike else set()
    left_out |= {"occ.", "rel. var."} if width < NARROW else set()
    names = [name for name in names if name not in left_out]
    for name in names:
        left = name == "tracker"
        table.add_column(
            name, justify="left" if left else "right", overflow="fold", no_wrap=not left
        )
    if ratio:
        table.add_column("x baseline", justify="right", no_wrap=True)
    best = best_of(rows)
    for row in sorted(rows, key=rank):
        cells = _cells(row, best=row in best)
        table.add_row(*(cells.get(name, "") for name in names), *([ratio(row)] if ratio else []))
    return table
