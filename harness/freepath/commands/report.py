"""`freepath report`: results as a page, a picture, Markdown, and small tables."""

from __future__ import annotations

import re
import sys
from argparse import ArgumentTypeError, Namespace
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shtab

from freepath.commands.arguments import add_baseline, expression
from freepath.errors import printable

if TYPE_CHECKING:
    from freepath.show.report import Report


def add(commands: Any) -> None:
    """Declare its arguments."""
    report = commands.add_parser(
        "report",
        help="show what accuracy costs in time",
        description="Write one HTML file that shows what accuracy costs in time, for one result or "
        "several side by side, and print which case is the fastest. Or write it as Markdown, or "
        "one of its charts as a picture.",
        allow_abbrev=False,
    )
    report.add_argument(
        "result", type=Path, nargs="+", metavar="RESULT", help="the folder of a run; may be several"
    ).complete = shtab.DIRECTORY
    report.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="where to write it: .html, .md, .tex, .bib, .svg, .png or .pdf, - to print it "
        "(default: report.html or a picture in RESULT; texts are printed)",
    ).complete = shtab.FILE
    report.add_argument(
        "--format",
        choices=("html", "md", "svg", "png", "pdf", "latex", "bibtex"),
        help="the format, where the name of FILE does not say: latex is tables of booktabs, bibtex "
        "what the trackers are from",
    )
    report.add_argument(
        "--chart",
        default="cost",
        metavar="NAME",
        help="which chart a picture is of: cost (default), pareto, tightness-time, "
        "tightness-lookups, lights, lookups, occupancy, devices, confirm",
    )
    for name, what in (("only", "cases whose name"), ("question", "questions whose text")):
        told = f"show only {what} matches"
        report.add_argument(f"--{name}", type=expression, default="", metavar="RE", help=told)
    told = "how wide a picture is, as 8.5cm, 85mm, 3.3in or 240pt; letters keep their size"
    report.add_argument("--width", type=_points, metavar="W", help=told)
    report.add_argument("--no-title", action="store_true", help="a picture without its titles")
    add_baseline(report)


POINTS = {"cm": 72 / 2.54, "mm": 7.2 / 2.54, "in": 72.0, "pt": 1.0}


def _points(text: str) -> float:
    found = re.fullmatch(r"([0-9.]+) ?(cm|mm|in|pt)", text.strip())
    with suppress(TypeError, ValueError):
        if 36 <= (value := float(found[1]) * POINTS[found[2]]) <= 7200:
            return value
    raise ArgumentTypeError(f"expected a width such as 8.5cm, 0.5in to 100in, got '{text}'")


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.commands.common import console_of
    from freepath.show import report
    from freepath.show.report.text import sentences, summary

    choice = report.Choice(
        options.chart, options.baseline, options.only, options.question, options.width,
        not options.no_title,
    )  # fmt: skip
    asked = options.result, options.output, options.format, choice
    printed = options.format in report.TEXTS and not options.output
    if printed or options.output == report.STANDARD_OUTPUT:
        found, data, _ = report.made(*asked)
        sys.stdout.flush()
        sys.stdout.buffer.write(data)
        _say_what_is_left_out(found)
        return 0
    found, path = report.write(*asked)
    console = console_of()
    console.print(summary(found))
    for line in sentences(found, options.baseline):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    console.print(f"wrote {path}", highlight=False, markup=False, soft_wrap=True)
    _say_what_is_left_out(found)
    return 0


def _say_what_is_left_out(found: Report) -> None:
    for one in found.left_out:
        print(printable(f"freepath: left out: {one}"), file=sys.stderr)
