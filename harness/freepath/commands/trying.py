"""`freepath try`: a new tracker in one file; is it right, and where does it pay?"""

from __future__ import annotations

import os
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shtab

from freepath.commands.arguments import add_device, positive
from freepath.errors import FAILED

if TYPE_CHECKING:
    from rich.console import Console

    from freepath.checks.outcome import Outcome
    from freepath.compose.catalog import Catalog, Tracker
    from freepath.device.opencl import Device
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
        help="measure it on this volume too: .vdb, .exr, .tif or .npy",
    ).complete = shtab.FILE
    trying.add_argument(
        "--sigma-t",
        type=positive,
        default=1.0,
        metavar="X",
        help="extinction where the volume's density is 1 (default: 1)",
    )
    add_device(trying, "part of the name, platform or driver of the device")
    trying.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="folder for checks, results and report (default: results/try-NAME-TIME)",
    ).complete = shtab.DIRECTORY
    trying.add_argument(
        "--every-check", action="store_true", help="the slow checks too, which take minutes"
    )
    trying.add_argument(
        "--checks-only", action="store_true", help="whether it is right, and nothing measured"
    )


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.commands.common import console_of, volume_of
    from freepath.device.selection import first, one_device
    from freepath.extras import candidate
    from freepath.results.folder import ResultFolder, new_folder

    known, tracker = candidate.read(options.tracker)
    volume = volume_of(options.volume, options.sigma_t) if options.volume else None
    path = options.output or new_folder(f"try-{tracker.name}")
    ResultFolder(path)  # refuses one that holds a run
    device, part = one_device(options.device), first(options.device)
    console = console_of()
    console.print(f"{tracker.title}, on {device.info.label}", highlight=False, markup=False)
    candidate.build(device, known, tracker)
    outcomes = _check(options, console, known, tracker, device)
    path.mkdir(parents=True, exist_ok=True)
    wrong = _say_verdict(console, outcomes, candidate.keep(outcomes, path))
    if wrong or options.checks_only:
        return FAILED if wrong else 0
    config = path / candidate.CONFIG
    config.write_text(
        candidate.sweep_text(tracker, candidate.relatives(known, tracker), volume), "utf-8"
    )
    return _measure(console, config, (known, tracker), part)


def _check(
    options: Namespace, console: Console, known: Catalog, tracker: Tracker, device: Device
) -> list[Outcome]:
    from freepath.extras import candidate

    chosen = candidate.checks_of(known, tracker, every=options.every_check)
    which = "all" if options.every_check else "fast"
    console.print(
        f"{len(chosen)} checks ({which}) that its front matter calls for", highlight=False
    )
    processes = min(2, os.cpu_count() or 1)
    with console.status("checking") as status:

        def tell(line: str) -> None:
            status.update(line.strip())

        return candidate.check(chosen, options.tracker, device.info, processes, tell)


def _say_verdict(console: Console, outcomes: list[Outcome], kept: Path) -> bool:
    """Say whether it is right, and what failed; tells whether it is wrong."""
    from freepath.extras import candidate

    wrong = candidate.failed(outcomes)
    told = {"highlight": False, "markup": False, "soft_wrap": True}
    if not wrong:
        skipped = len(outcomes) - candidate.passed(outcomes)
        beside = f", {skipped} do not apply" if skipped else ""
        console.print(f"right: {candidate.passed(outcomes)} checks passed{beside}", **told)
        return False
    console.print(f"wrong: {len(wrong)} of {len(outcomes)} checks failed", **told)
    for one in wrong:
        text = one.text.strip().splitlines()
        console.print(f"  {one.name}\n      {text[-1] if text else one.status}", **told)
    console.print(f"wrote {kept}; a wrong tracker is not measured", **told)
    return True


def _measure(
    console: Console,
    config: Path,
    trackers: tuple[Catalog, Tracker],
    part: Part,
) -> int:
    """Measure it beside its relatives, write the report and say where it pays."""
    from freepath import api
    from freepath.commands.run import _shown_progress
    from freepath.extras import candidate
    from freepath.measure import worker
    from freepath.show import report, table
    from freepath.show.report.text import sentences, summary

    known, tracker = trackers
    with _shown_progress(console) as listener:
        sweep = api.sweep(config, config.parent, known=known, listener=listener)
        worker.run(sweep, part)
    folder = sweep.folder
    found, page = report.write([folder.folder], None, "html")
    console.print("", summary(found), "")
    told = {"highlight": False, "markup": False, "soft_wrap": True}
    for line in sentences(found):
        console.print(line, **told)
    for standing in candidate.standings(found, tracker):
        console.print(f"{standing.question}:\n  {standing}", **told)
    console.print(f"wrote {page}", **told)
    failures = [row for row in table.failures(folder.rows()) if row["tracker"] == tracker.name]
    for row in failures:
        console.print(f"{row['status']}: {row['case']}: {row['reason']}", **told)
    return FAILED if failures else 0
