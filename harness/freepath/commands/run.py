"""`freepath run`: a sweep, its progress, its table and its result files."""

from __future__ import annotations

import json
import re
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from freepath.commands.arguments import (
    add_baseline,
    add_config,
    add_device,
    add_output,
    add_timeout,
    shard,
)
from freepath.commands.common import cases_of, console_of, print_tables, unread
from freepath.errors import FAILED, INTERRUPTED, UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from freepath.cases.plan import Case
    from freepath.compose.catalog import Catalog
    from freepath.config import Config
    from freepath.device.selection import Part, Parts
    from freepath.measure.sweep import Listener, Sweep
    from freepath.results.folder import ResultFolder

NAMED = 3
"""Cases of a driver that are named where it did not finish them; of more, only the number."""


def add(commands: Any) -> None:
    """Declare its arguments."""
    run = commands.add_parser(
        "run",
        help="run a sweep",
        description="Run the cases of a config, print a table and write summary.csv, samples.csv "
        "and run.json.",
        allow_abbrev=False,
    )
    add_config(run)
    add_device(
        run,
        "part of the name, platform or driver of a device, a name that `freepath devices` shows "
        "behind -d, or 'all'; may be repeated",
    )
    run.add_argument("-N", "--show-only", action="store_true", help="list the cases and stop")
    add_output(run, "the results", "NAME")
    run.add_argument(
        "--resume",
        action="store_true",
        help="go on with the run in DIR (default: the newest of this config): rows whose config, "
        "source, device and driver are unchanged are kept, if pictures that were wanted are there",
    )
    run.add_argument(
        "--confirm",
        action="store_true",
        help="measure the error of each case at three more sample counts, write it beside the "
        "prediction into confirm.csv, and say how many predictions hold",
    )
    run.add_argument(
        "--work-group",
        type=int,
        metavar="N",
        help="run kernels in work-groups of N work-items (default: 1 on CPUs, and elsewhere the "
        "fastest of a short calibration)",
    )
    told = "run all N times, into DIR/NAME-1 to DIR/NAME-N: DIR is a side for `freepath compare`"
    run.add_argument("--repeat", type=int, default=1, metavar="N", help=told)
    run.add_argument(
        "--shard",
        type=shard,
        metavar="I/N",
        help="only the I-th of N parts of the cases, which `freepath merge` joins",
    )
    run.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="measure on the workers (`freepath worker ADDRESS`) of dask's scheduler there",
    )
    run.add_argument("--json", action="store_true", help="print the rows as JSON, nothing else")
    add_baseline(run)
    add_timeout(run)


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    started = time.perf_counter()
    loaded, known, cases = cases_of(options)
    if options.shard:
        from freepath.cases import plan

        cases = plan.shard(cases, *options.shard)
    if options.show_only:
        return _show_only(options, cases)
    if options.baseline and not any(re.search(options.baseline, case.name) for case in cases):
        raise UsageError(f"--baseline {options.baseline}: no case has a name that matches")
    from freepath.device import selection
    from freepath.measure import worker

    if options.repeat != 1:
        return _repeat(options, loaded.name)
    if options.cluster:
        from freepath.measure import cluster

        def say(text: str) -> None:
            print(f"freepath: {text}", file=sys.stderr)

        with cluster.Cluster(options.cluster, say) as there:
            parts = there.parts(options.device)
            return _measure(options, parts, there.run, (loaded, known, cases), started)
    parts = selection.checked(selection.resolve(options.device))
    return _measure(options, parts, worker.run, (loaded, known, cases), started)


def _measure(
    options: Namespace,
    parts: Parts,
    run: Callable[[Sweep, Part, float | None], None],
    given: tuple[Config, Catalog, list[Case]],
    started: float,
) -> int:
    """Measure the cases on each part by `run`, and show them; returns the exit code."""
    from freepath import api
    from freepath.device import environment
    from freepath.measure.sweep import Clock
    from freepath.results import folder as results

    loaded, known, cases = given
    load, clock = environment.load(), Clock(started)
    found = results.newest_folder if options.resume else results.new_folder
    path = options.output or found(loaded.name)
    # refuses what it cannot write to
    _say_what_was_at_work(results.ResultFolder(path, resume=options.resume))
    made: list[Sweep] = []

    def make(resume: bool) -> Sweep:
        more = {"confirm": options.confirm, "clock": clock, "work_group": options.work_group}
        more |= {"resume": resume or options.resume}
        if options.shard:
            more["beside"] = {"shard": "{}/{}".format(*options.shard)}
        made.append(api.sweep(loaded, path, known=known, cases=cases, **more))
        return made[-1]

    @contextmanager
    def watched(part: Part) -> Iterator[Listener]:
        if len(parts) > 1 and not options.json:
            with unread():
                print(f"{part.driver.name}: {part.driver.title}", flush=True)
        with _shown_progress(console_of(stderr=options.json)) as listener:
            yield listener

    failed = 0
    try:
        for part, sweep in api.each_driver(
            parts, make, lambda sweep, part: run(sweep, part, options.timeout), watched
        ):
            if part.failure:
                failed = FAILED
                _say_what_is_missing(part, cases, sweep)
    except KeyboardInterrupt:
        if not made:
            raise
        _say_how_to_resume(made[-1])
        return INTERRUPTED
    if not made or not made[-1].folder.holds_rows:
        return failed
    return max(_show(options, made[-1].folder, cases, load, made[-1]), failed)


def _repeat(options: Namespace, name: str) -> int:
    """Run the whole sweep several times into folders of one; returns the worst exit code."""
    from freepath.results.folder import SUMMARY, new_folder

    if options.repeat < 1 or options.json or (options.resume and not options.output):
        raise UsageError("--repeat: expected 1 or more, no --json, and -o DIR with --resume")
    base, worst = options.output or new_folder(name), 0
    for number in range(1, options.repeat + 1):
        folder = base / f"{name}-{number}"
        resume = options.resume and (folder / SUMMARY).exists()
        one = vars(options) | {"repeat": 1, "output": folder, "resume": resume}
        if (code := execute(Namespace(**one))) == INTERRUPTED:
            return code
        worst = max(worst, code)
    return worst


def _say_what_was_at_work(folder: ResultFolder) -> None:
    if noted := folder.noted:
        told = f"the run before was killed at work on {noted}"
        print(f"freepath: {folder.folder}: {told}", file=sys.stderr)


def _say_what_is_missing(part: Part, cases: list[Case], sweep: Sweep | None) -> None:
    """Why a driver failed, and which cases have no row of it where its process ended too early."""
    if sweep is None:
        told = f"{part.driver.name} cannot be used here: {part.failure}"
        return print(f"freepath: {told}", file=sys.stderr)
    print(f"freepath: {part.failure}", file=sys.stderr)
    folder = sweep.folder
    columns = ("case_id", "device", "platform", "driver_version")
    rows = folder.rows() if folder.holds_rows else []
    done = {tuple(row[column] for column in columns) for row in rows}
    for info in part.infos:
        place = (info.name, info.platform, info.driver_version)
        missing = [case.name for case in cases if (case.case_id, *place) not in done]
        if missing:
            names = ", ".join(missing[:NAMED]) + ", ..." * (len(missing) > NAMED)
            told = f"{len(missing)} of {len(cases)} cases were not finished on {info.label}"
            print(f"freepath: {part.driver.name}: {told}: {names}", file=sys.stderr)
    if not part.infos:
        told = f"it showed no device, so that none of {len(cases)} cases was run"
        print(f"freepath: {part.driver.name}: {told}", file=sys.stderr)
    if rows:
        told = f"go on with the same command and -o {folder.folder} --resume"
        print(f"freepath: {part.driver.name}: {told}", file=sys.stderr)
    return None


def _show(
    options: Namespace,
    folder: ResultFolder,
    cases: list[Case],
    load: float,
    sweep: Sweep,
) -> int:
    """Print what the folder holds, and what failed; returns the exit code."""
    from freepath.results.folder import records

    rows = _in_order(folder.rows(), cases)
    with unread():
        if options.json:
            print(json.dumps(records(rows), indent=1), flush=True)
        else:
            _print(options, folder, rows, load, sweep)
    return _say_failures(rows)


def _print(
    options: Namespace, folder: ResultFolder, rows: list[dict[str, str]], load: float, sweep: Sweep
) -> None:
    from freepath.show import table

    console = console_of(width=80)
    for told in folder.read_run().get("inputs") or ():
        console.print(told, highlight=False, markup=False, soft_wrap=True)
    print_tables(console, rows, load, options.baseline)
    if not options.cluster:  # elsewhere, times of several machines are no shares of one
        _print_times(console, sweep)
    if options.confirm:
        console.print(table.confirmed(folder.confirmed()), highlight=False)
    for written in folder.paths():
        console.print(f"wrote {written}", highlight=False, markup=False, soft_wrap=True)


@contextmanager
def _shown_progress(console: Console, *, rows: bool = True) -> Iterator[Listener]:
    """A bar on a terminal; elsewhere a line a case, if `rows`."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as Remaining

    from freepath.measure.sweep import Listener

    columns = (
        TextColumn("{task.completed:.0f}/{task.total:.0f} cases"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        Remaining(elapsed_when_finished=False),
        TextColumn("{task.description}"),
    )
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=0)

        class Shown(Listener):
            def row(self, row: dict[str, Any]) -> None:
                if rows and not console.is_terminal:
                    line = f"{row['status']:>8}  {row['case']}"
                    with unread():
                        console.print(line, highlight=False, markup=False, soft_wrap=True)

            def progress(self, done: float, total: int, what: str) -> None:
                bar.update(task, completed=done, total=total, description=what)

        yield Shown()


def _say_how_to_resume(sweep: Sweep) -> None:
    done = f"interrupted with {sweep.ended} of {sweep.total} cases done"
    path = sweep.folder.folder
    if sweep.folder.holds_rows:
        done += f"; go on with the same command and -o {path} --resume"
    print(f"freepath: {done}", file=sys.stderr)


def _in_order(rows: list[dict[str, str]], cases: list[Case]) -> list[dict[str, str]]:
    """Rows in the order of the cases; further ones that a resumed folder may hold come last."""
    order = {case.case_id: case.index for case in cases}
    last = max(order.values()) + 1
    return sorted(rows, key=lambda row: order.get(row["case_id"], last))


def _say_failures(rows: list[dict[str, str]]) -> int:
    """Say what failed, each cause once; returns the exit code."""
    from freepath.show import table

    causes: dict[tuple[str, str], list[str]] = {}
    for row in table.failures(rows):
        # a log is of one case; what it says may be what others say
        cause = re.sub(r" \(build-\w+\.log\)$", "", row["reason"])
        causes.setdefault((row["status"], cause), []).append(row["case"])
    for (status, reason), names in causes.items():
        several = f"{len(names)} cases, the first of them {names[0]}"
        print(
            f"freepath: {status}: {reason}: {several if names[1:] else names[0]}", file=sys.stderr
        )
    return FAILED if causes else 0


def _print_times(console: Console, sweep: Sweep) -> None:
    if not sweep.total:
        console.print("nothing was left to run")
        return
    clock, times = sweep.clock, sweep.clock.as_dict()
    console.print(
        f"device time {100 * times['device_time_share']:.0f} % of {clock.outside_s:.1f} s outside "
        f"compilation; compilation {clock.build_s:.1f} s",
        highlight=False,
    )


def _show_only(options: Namespace, cases: list[Case]) -> int:
    if options.json:
        named = [
            case.identity() | {"name": case.name, "skipped": case.skip_reason} for case in cases
        ]
        print(json.dumps(named, indent=1))
        return 0
    for case in cases:
        reason = f"  (skipped: {case.skip_reason})" if case.skip_reason else ""
        print(f"{case.index:>5}  {case.name}{reason}")
    print(f"\n{len(cases)} cases")
    return 0
