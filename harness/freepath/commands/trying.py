"""`freepath try`: a new tracker in one file; is it right, and where does it pay?"""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

import shtab

from freepath.commands.arguments import add_device, add_output, add_sigma_t, add_timeout
from freepath.errors import FAILED, INTERRUPTED


def add(commands: Any) -> None:
    """Declare its arguments."""
    trying = commands.add_parser(
        "try",
        help="check a new tracker and measure it beside its relatives",
        description="Run the fast checks that the front matter of a new tracker claims, and, where "
        "they pass, measure it beside the trackers most like it and write a report. Exits with 8 "
        "where it is wrong, naming the checks that fail.",
        allow_abbrev=False,
    )
    trying.add_argument(
        "tracker", type=Path, metavar="TRACKER.cl", help="the file of the new tracker"
    ).complete = shtab.FILE
    trying.add_argument(
        "--volume",
        type=Path,
        metavar="FILE",
        help="measure it on this volume too",
    ).complete = shtab.FILE
    add_sigma_t(trying)
    trying.add_argument(
        "--like",
        default="",
        metavar="NAME",
        help="what to compare it with (default: `like:` of its front matter, or the nearest)",
    )
    add_device(trying, "part of the name, platform or driver of the device")
    add_output(trying, "checks, results and report", "try-NAME")
    add_timeout(trying)
    trying.add_argument(
        "--every-check", action="store_true", help="the slow checks too, which take minutes"
    )
    trying.add_argument(
        "--checks-only", action="store_true", help="whether it is right, and nothing measured"
    )


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.commands.common import console_of
    from freepath.commands.run import _shown_progress
    from freepath.extras import candidate
    from freepath.show import report, table
    from freepath.show.report.text import summary

    console = console_of()

    def say(line: str) -> None:
        console.print(line, highlight=False, markup=False, soft_wrap=True)

    asked = (options.like, options.volume, options.sigma_t, options.device, options.output)
    trial = candidate.prepared(options.tracker, *asked, every=options.every_check, say=say)
    with console.status("checking") as status:
        trial.check(status.update)
    if trial.right and not options.checks_only:
        with _shown_progress(console) as listener:
            trial.measure(listener, options.timeout)
    if trial.result:
        console.print("", summary(report.load([trial.folder])), "")
        trial.compare()
        for row in table.failures(trial.own_rows):
            say(f"{row['status']}: {row['case']}: {row['reason']}")
    if trial.interrupted:
        return INTERRUPTED
    return FAILED if not trial.right or (trial.result and table.failures(trial.own_rows)) else 0
