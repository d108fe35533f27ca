"""The command `freepath`."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from freepath.arguments import parser
from freepath.errors import (
    FAILED,
    INTERRUPTED,
    USAGE,
    ConfigError,
    FreepathError,
    NothingMatchedError,
    Problem,
)

if TYPE_CHECKING:
    from freepath.catalog import Catalog
    from freepath.config import Config
    from freepath.plan import Case
    from freepath.run import Run
    from rich.console import Console

# What a command needs is imported by it: `--help`, `list` and completion do without the rest.


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code. A user's mistake is a message, never a traceback."""
    options = parser().parse_args(arguments)
    command = COMMANDS[options.command]
    try:
        with _terminated_like_interrupted():
            code = command(options)
            sys.stdout.flush()
        return code
    except FreepathError as error:
        print(f"freepath: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("freepath: interrupted", file=sys.stderr)
        return INTERRUPTED
    except MemoryError:
        print("freepath: out of memory", file=sys.stderr)
        return FAILED
    except BrokenPipeError:
        # The reader of a pipe has seen enough; Python must not complain when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


@contextmanager
def _terminated_like_interrupted() -> Iterator[None]:
    """Let SIGTERM do what Ctrl-C does, so that what is under way is left in order."""

    def interrupt(signum: int, frame: Any) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _cases(options: Namespace) -> tuple[Config, Catalog, list[Case]]:
    from freepath import catalog, config, plan

    known = catalog.load(options.trackers)
    path = config.find(options.config)
    loaded = config.load(path, known.parameter_models(), options.axis)
    cases = plan.select(plan.expand(loaded, known), options.include, options.exclude)
    return loaded, known, cases


def _run(options: Namespace) -> int:
    started = time.perf_counter()
    loaded, known, cases = _cases(options)
    if options.show_only:
        return _show_only(options, cases)
    from freepath import environment, run
    from freepath.device import open_devices
    from freepath.results import ResultFolder, records

    load = environment.load()
    devices = open_devices(options.device)
    path = options.output or (run.newest_folder if options.resume else run.new_folder)(loaded.name)
    folder, clock = ResultFolder(path, resume=options.resume), run.Clock(started)
    console = _console(stderr=options.json)
    with _shown_progress(console) as (on_done, on_progress):
        sweep = run.Run(loaded, known, cases, folder, clock, on_done, on_progress)
        try:
            sweep.execute(devices)
        except KeyboardInterrupt:
            _say_how_to_resume(sweep)
            return INTERRUPTED
    rows = _in_order(folder.rows(), cases)
    if options.json:
        print(json.dumps(records(rows), indent=1))
    else:
        _print_tables(console, rows, load)
        _print_times(console, sweep)
        for written in folder.paths():
            console.print(f"wrote {written}", highlight=False, markup=False, soft_wrap=True)
    return _say_failures(rows)


@contextmanager
def _shown_progress(console: Console) -> Iterator[tuple[Any, Any]]:
    """A bar on a terminal, a line a case elsewhere; gives what Run tells rows and progress to."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as Remaining

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

        def on_done(row: dict[str, Any]) -> None:
            if not console.is_terminal:
                line = f"{row['status']:>8}  {row['case']}"
                console.print(line, highlight=False, markup=False, soft_wrap=True)

        def on_progress(done: float, total: int, what: str) -> None:
            bar.update(task, completed=done, total=total, description=what)

        yield on_done, on_progress


def _say_how_to_resume(sweep: Run) -> None:
    done = f"interrupted with {sweep.ended} of {sweep.total} cases done"
    path = sweep.folder.folder
    if sweep.folder.is_open:
        done += f"; go on with the same command and -o {path} --resume"
    print(f"freepath: {done}", file=sys.stderr)


def _in_order(rows: list[dict[str, str]], cases: list[Case]) -> list[dict[str, str]]:
    """Rows in the order of the cases; further ones that a resumed folder may hold come last."""
    order = {case.case_id: case.index for case in cases}
    last = max(order.values()) + 1
    return sorted(rows, key=lambda row: order.get(row["case_id"], last))


def _say_failures(rows: list[dict[str, str]]) -> int:
    from freepath import table

    failed = table.failures(rows)
    for row in failed:
        print(f"freepath: {row['status']}: {row['case']}: {row['reason']}", file=sys.stderr)
    return FAILED if failed else 0


def _print_tables(console: Console, rows: list[dict[str, str]], load: float) -> None:
    from freepath import environment, table

    for device, members in table.by_device(rows).items():
        console.print(f"{device}\n{environment.processor()}, load {load:.2f}", markup=False)
        for group in table.groups(members):
            console.print("", table.table_of(group))
    for reason, count in table.skipped(rows).items():
        noun = "case" if count == 1 else "cases"
        console.print(f"skipped {count} {noun}: {reason}", highlight=False, markup=False)
    console.print(f"\n{table.LEGEND}\n", highlight=False)


def _print_times(console: Console, sweep: Run) -> None:
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


def _source(options: Namespace) -> int:
    loaded, known, cases = _cases(options)
    case = _chosen(options, cases)
    from freepath import run, source, sweep
    from freepath.device import open_devices
    from freepath.scene import build_medium

    if case.skip_reason:
        print(f"freepath: {case.name} has no source: {case.skip_reason}", file=sys.stderr)
        return USAGE
    device = open_devices(options.device)[0]
    medium = build_medium(case.medium, run.search_path(loaded))
    structure = sweep.structure_of(case, known, medium, device, count=False)
    print(source.compose(structure).text)
    return 0


def _chosen(options: Namespace, cases: list[Case]) -> Case:
    """The case of --case, or the only one that the filters leave."""
    if options.case is None:
        if len(cases) > 1:
            message = f"expected --case N: {len(cases)} cases match"
            raise ConfigError([Problem(options.config, 0, 0, "", message)])
        return cases[0]
    for case in cases:
        if case.index == options.case:
            return case
    raise NothingMatchedError(
        f"no case {options.case} among {len(cases)}; see `freepath run {options.config} -N`"
    )


def _list(options: Namespace) -> int:
    from freepath import catalog, listing

    records = listing.records_of(options.what, catalog.load(options.trackers))
    return _print_records(records, as_json=options.json)


def _devices(options: Namespace) -> int:
    from freepath import listing
    from freepath.device import NO_DEVICE, list_devices

    records = listing.devices(list_devices())
    if not records and not options.json:
        print(f"freepath: {NO_DEVICE}", file=sys.stderr)
    return _print_records(records, as_json=options.json)


def _print_records(records: list[dict[str, Any]], *, as_json: bool) -> int:
    from freepath import listing

    if as_json:
        print(json.dumps(records, indent=1))
    else:
        _console().print(listing.table_of(records))
    return 0


def _console(*, stderr: bool = False) -> Console:
    """A console; one that is no terminal has no width that a table should be folded to."""
    from rich.console import Console

    class Plain(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # which main knows; rich would exit with 1

    console = Plain(stderr=stderr)
    return console if console.is_terminal else Plain(stderr=stderr, width=160)


def _report(options: Namespace) -> int:
    from freepath import report

    print(f"wrote {report.write(options.result, options.output)}")
    return 0


COMMANDS = {
    "run": _run,
    "report": _report,
    "source": _source,
    "list": _list,
    "devices": _devices,
}
