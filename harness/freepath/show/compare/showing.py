"""A comparison as a table, as CSV and as a page; several contenders as a matrix."""

from __future__ import annotations

import csv
import html
import io
import json
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from freepath.results.folder import no_formula
from freepath.show import markdown
from freepath.show.compare.judging import REGRESSIONS, VERDICTS, Judged
from freepath.show.table import short

COLUMNS = (
    "verdict", "case", "device", "time_ratio", "time_low", "time_high", "variance_ratio",
    "difference", "z_score", "lookups_ratio", "p_value", "seen_from", "runs", "why",
)  # fmt: skip
HEADER = (
    "verdict", "case", "time contender/reference", "variance c/r", "difference", "z", "lookups c/r",
    "why",
)  # fmt: skip
MOST_UNDECIDED = 8
"""Of more undecided cases only their number is told."""
LIMITS = "1 is no change, above 1 the contender is slower, noisier, or looks up more"
STYLE = """:root{color-scheme:light dark}body{font:15px/1.4 system-ui,sans-serif;margin:1rem auto;
max-width:1400px;padding:0 1rem}div{overflow-x:auto}table{border-collapse:collapse;font-size:.9rem}
td,th{padding:.25rem .6rem;border-bottom:1px solid #8884;text-align:left;white-space:nowrap}
.bad{color:#d33;font-weight:600}.good{color:#2a8a3e}"""


def record(one: Judged) -> dict[str, Any]:
    """A judged case as a row of CSV; ratios are contender over reference."""
    found = {name: getattr(one, name, None) for name in COLUMNS}
    return found | {"case": one.row["case"], "device": one.row["device"]}


def cells(one: Judged) -> list[str]:
    """A judged case as texts."""
    time = ""
    if one.time_ratio is not None:
        time = f"{one.time_ratio:.3g} ({one.time_low:.3g} to {one.time_high:.3g})"
    difference = "" if one.difference is None else f"{100 * one.difference:+.2g}%"
    numbers = short(one.variance_ratio), difference, short(one.z_score), short(one.lookups_ratio)
    return [one.verdict, one.row["case"], time, *numbers, one.why]


def lines(judged: Sequence[Judged], *, everything: bool) -> list[str]:
    """Two lines a case: of those that are not the same, but few of the undecided, or of all."""
    undecided = sum(one.verdict == "UNDECIDED" for one in judged)
    hidden = {"SAME", "UNDECIDED"} if undecided > MOST_UNDECIDED else {"SAME"}
    found = []
    for one in judged:
        if everything or one.verdict not in hidden:
            verdict, case, *numbers, why = cells(one)
            named = zip(HEADER[2:-1], numbers, strict=True)
            told = [f"{name} {text}" for name, text in named if text]
            found += [f"{verdict:<10} {case}", f"    {'; '.join([*told, *filter(None, [why])])}"]
    return found


def undecided(judged: Sequence[Judged], to_show: float) -> str:
    """What undecided times could have shown, and what would show more; '' where there are none."""
    seen = sorted(one.seen_from for one in judged if one.seen_from is not None)
    if not seen:
        return ""
    runs = [one.runs for one in judged if one.seen_from is not None]
    wanted = f"{100 * (to_show - 1):.2g} %"
    text = f"times: no change below x{seen[0]:.3g}"
    text += f" to x{seen[-1]:.3g}, by case," if len(seen) > 1 else ""
    text += " would have been seen (95 %); "
    if None in runs:
        return text + f"no number of runs would show {wanted}: measure on a quieter machine"
    return text + f"{max(runs)} runs per side would show {wanted}"


def totals(judged: Sequence[Judged]) -> str:
    """How many cases got each verdict."""
    counts = Counter(one.verdict for one in judged)
    return ", ".join(f"{counts[name]} {name}" for name in VERDICTS if counts[name])


def shift_lines(shifts: dict[Any, tuple[float, float]]) -> list[str]:
    """What all cases of a scene changed by together, where that is 2 % or more."""
    lines = []
    for scene, (shift, taken) in shifts.items():
        if abs(shift) < 0.02:
            continue
        line = f"{scene[2]}: all times together x{math.exp(shift):.3g}"
        if taken:
            line += f", of which x{math.exp(taken):.3g} is taken for a drift of the machine"
        lines.append(line)
    return lines


def matrix(names: Sequence[str], results: Sequence[Sequence[Judged]]) -> tuple[list, list[list]]:
    """Header and rows: cases down, contenders across, verdict and time ratio in each field."""
    cases: dict[tuple, dict[int, str]] = {}
    titles: dict[tuple, str] = {}
    for place, judged in enumerate(results):
        for one in judged:
            ratio = "" if one.time_ratio is None else f" {one.time_ratio:.3g}"
            cases.setdefault(one.key, {})[place] = one.verdict + ratio
            titles[one.key] = one.row["case"]
    rows = [
        [titles[key], *(found.get(place, "") for place in range(len(names)))]
        for key, found in cases.items()
    ]
    return ["case", *names], rows


def matrix_table(names: Sequence[str], results: Sequence[Sequence[Judged]]) -> Table:
    """The matrix for a terminal."""
    header, rows = matrix(names, results)
    found = Table(box=None, padding=(0, 1, 0, 0), caption=LIMITS, caption_justify="left")
    for name in header:
        found.add_column(escape(name), overflow="fold")
    for row in rows:
        found.add_row(*map(escape, row))
    return found


def as_json(names: Sequence[str], results: Sequence[Sequence[Judged]]) -> str:
    """All rows of all contenders."""
    pairs = zip(names, results, strict=True)
    found = [{"contender": name} | record(one) for name, judged in pairs for one in judged]
    return json.dumps(found, indent=1, allow_nan=False) + "\n"


def as_markdown(
    reference: str, names: Sequence[str], results: Sequence[Sequence[Judged]], to_show: float
) -> str:
    """For a pull request: what is not the same first, and the rest folded away."""
    parts = []
    for name, judged in zip(names, results, strict=True):
        title = markdown.text_of(f"{name} compared with {reference}")
        parts += [f"**{title}: {totals(judged)}**", "", undecided(judged, to_show), ""]
        changed = [cells(one) for one in judged if one.verdict not in ("SAME", "UNDECIDED")]
        others = [cells(one) for one in judged if one.verdict in ("SAME", "UNDECIDED")]
        if changed:
            parts += [*markdown.table_of(HEADER, changed), ""]
        if others:
            parts += [f"<details><summary>{len(others)} others</summary>", ""]
            parts += [*markdown.table_of(HEADER, others), "", "</details>", ""]
    return "\n".join([*parts, f"{LIMITS}.", ""])


def write_junit(
    path: Path, names: Sequence[str], results: Sequence[Sequence[Judged]], fail_on: Sequence[str]
) -> None:
    """A suite a contender: cases whose verdict is of fail_on fail, those undecided are skipped."""
    from junitparser import Failure, JUnitXml, Skipped, TestCase, TestSuite

    report = JUnitXml("freepath compare")
    for name, judged in zip(names, results, strict=True):
        suite, cases = TestSuite(name), []
        for one in judged:
            case = TestCase(one.row["case"], one.row["device"])
            if one.verdict in fail_on:
                case.result = [Failure("; ".join(filter(None, cells(one)[2:])), one.verdict)]
            elif one.verdict == "UNDECIDED":
                case.result = [Skipped(one.why)]
            cases.append(case)
        suite.add_testcases(cases)
        report.add_testsuite(suite)
    report.update_statistics()
    report.write(str(path), pretty=True)


def as_csv(names: Sequence[str], results: Sequence[Sequence[Judged]]) -> str:
    """All rows of all contenders."""
    file = io.StringIO()
    writer = csv.DictWriter(file, ("contender", *COLUMNS), lineterminator="\n")
    writer.writeheader()
    for name, judged in zip(names, results, strict=True):
        for one in judged:
            row = {"contender": name} | record(one)
            texts = {key: no_formula(cell) for key, cell in row.items() if isinstance(cell, str)}
            writer.writerow(row | texts)
    return file.getvalue()


def as_html(reference: str, names: Sequence[str], results: Sequence[Sequence[Judged]]) -> str:
    """A page of its own, which loads nothing; several contenders begin with the matrix."""
    parts = [f"<h1>Compared with {html.escape(reference)}</h1><p>{LIMITS}.</p>"]
    if len(names) > 1:
        parts.append(markdown.html_table(*matrix(names, results), _class))
    for name, judged in zip(names, results, strict=True):
        parts.append(f"<h2>{html.escape(name)}</h2><p>{totals(judged)}</p>")
        parts.append(markdown.html_table(HEADER, [cells(one) for one in judged], _class))
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" '
        f'content="width=device-width"><title>freepath compare</title><style>{STYLE}</style>'
        f"{''.join(parts)}</html>\n"
    )


def _class(text: str) -> str:
    word = text.split(" ", 1)[0]
    if word in REGRESSIONS:
        return ' class="bad"'
    return ' class="good"' if word in ("FASTER", "LESS_NOISE") else ""
