"""`freepath try`: a new tracker in one file; is it right, and where does it pay?"""

from __future__ import annotations

import os
import time
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shtab

from freepath.commands.arguments import add_device, add_output, add_sigma_t, add_timeout
from freepath.errors import FAILED, INTERRUPTED

if TYPE_CHECKING:
    from rich.console import Console

    from freepath.checks.outcome import Outcome
    from freepath.compose.catalog import Catalog, Tracker
    from freepath.device.selection import Part


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
    from freepath.commands.common import console_of, own_folder, volume_of
    from freepath.device.selection import first, one_device
    from freepath.extras import candidate
    from freepath.results.folder import new_folder, write

    known, tracker, parent = candidate.read(options.tracker, options.like)
    volume = volume_of(options.volume, options.sigma_t)[1] if options.volume else None
    path = options.output or new_folder(f"try-{tracker.name}")
    device, part = one_device(options.device), first(options.device)
    console = console_of()
    console.print(f"{tracker.title}, on {device.info.label}", highlight=False, markup=False)
    started = time.monotonic()
    candidate.build(device, known, tracker)
    compiling_s = time.monotonic() - started
    own_folder(path, "try")
    chosen = candidate.checks_of(known, tracker, every=options.every_check)
    which = "all" if options.every_check else "fast"
    console.print(
        f"{len(chosen)} checks ({which}) that its front matter calls for", highlight=False
    )
    processes = min(2, os.cpu_count() or 1)
    with console.status("checking") as status:
        outcomes, stopped = candidate.check(
            chosen, options.tracker, device.info, processes, status.update, compiling_s
        )
    wrong = _say_verdict(console, outcomes, candidate.keep(outcomes, path), stopped)
    if stopped == candidate.INTERRUPTED:
        return INTERRUPTED
    if wrong or options.checks_only:
        return FAILED if wrong else 0
    config = path / candidate.CONFIG
    others = {one.name: one for one in (parent, *candidate.relatives(known, tracker))}
    few = list(others.values())[: candidate.RELATIVES]
    write(config, candidate.sweep_text(tracker, few, volume))
    return _measure(console, config, (known, tracker, parent), part, options.timeout)


def _say_verdict(console: Console, outcomes: list[Outcome], kept: Path, stopped: str) -> bool:
    """Say whether it is right, and what failed; tells whether it is wrong."""
    from freepath.checks.outcome import SKIPPED

    wrong = [one for one in outcomes if one.wrong]
    right = sum(not one.wrong and one.status != SKIPPED for one in outcomes)
    told = {"highlight": False, "markup": False, "soft_wrap": True}
    if stopped:
        console.print(f"{stopped}; {len(outcomes)} checks were run", **told)
    if not wrong:
        skipped = len(outcomes) - right
        beside = f", {skipped} do not apply" if skipped else ""
        verdict = "none failed so far" if stopped else "right"
        console.print(f"{verdict}: {right} checks passed{beside}", **told)
        return False
    console.print(f"wrong: {len(wrong)} of {len(outcomes)} checks failed", **told)
    for one in wrong:
        text = one.text.strip().splitlines()
        console.print(f"  {one.name}\n      {text[-1] if text else one.status}", **told)
    console.print(f"wrote {kept}; a wrong tracker is not measured", **told)
    return True


Trackers = tuple["Catalog", "Tracker", "Tracker"]


def _measure(
    console: Console, config: Path, trackers: Trackers, part: Part, timeout_s: float | None
) -> int:
    """Measure it beside its relatives, write the report and say where it pays."""
    from freepath import api
    from freepath.commands.run import _shown_progress
    from freepath.extras import candidate
    from freepath.measure import worker
    from freepath.show import report, table
    from freepath.show.report.text import sentences, summary

    known, tracker, parent = trackers
    with _shown_progress(console) as listener:
        sweep = api.sweep(config, config.parent, known=known, listener=listener)
        try:
            worker.run(sweep, part, timeout_s)
        except KeyboardInterrupt:
            where = f"its folder is {config.parent}, which `freepath report` shows"
            console.print(f"interrupted with {sweep.ended} of {sweep.total} cases; {where}")
            return INTERRUPTED
    folder = sweep.folder
    found, page = report.write([folder.folder], None, "html")
    console.print("", summary(found), "")
    told = {"highlight": False, "markup": False, "soft_wrap": True}
    for line in sentences(found):
        console.print(line, **told)
    for line in candidate.beside_parent(folder.rows(), tracker.name, parent.name):
        console.print(line, **told)
    console.print(f"wrote {page}", **told)
    failures = [row for row in table.failures(folder.rows()) if row["tracker"] == tracker.name]
    for row in failures:
        console.print(f"{row['status']}: {row['case']}: {row['reason']}", **told)
    return FAILED if failures else 0
