"""`freepath report`: results as a page, a picture, Markdown, and small tables."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shtab

from freepath.commands.arguments import add_baseline
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
        help="where to write it: .html, .md, .svg or .png, - to print it (default: report.html or "
        "a picture in RESULT; Markdown is printed)",
    ).complete = shtab.FILE
    report.add_argument(
        "--format",
        choices=("html", "md", "svg", "png"),
        help="the format, where the name of FILE does not say",
    )
    report.add_argument(
        "--chart",
        default="cost",
        metavar="NAME",
        help="which chart a picture is of: cost (default), pareto, tightness-time, "
        "tightness-lookups, lights, lookups, occupancy, devices, confirm",
    )
    add_baseline(report)


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.commands.common import console_of
    from freepath.show import report
    from freepath.show.report.text import sentences, summary

    asked = options.result, options.output, options.format, options.chart, options.baseline
    markdown = options.format == "md" and not options.output
    if markdown or options.output == report.STANDARD_OUTPUT:
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
