"""The command `freepath`."""

from __future__ import annotations

import json
import os
import sys
import time
from argparse import Namespace
from collections import Counter
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from freepath import catalog, config, listing, plan
from freepath.arguments import parser
from freepath.errors import FAILED, INTERRUPTED, USAGE, ConfigError, FreepathError, Problem


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code. A user's mistake is a message, never a traceback."""
    options = parser().parse_args(arguments)
    command = {"run": _run, "source": _source, "list": _list, "devices": _devices}[options.command]
    try:
        return command(options)
    except FreepathError as error:
        print(f"freepath: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("freepath: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of a pipe has seen enough; Python must not complain when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _cases(options: Namespace) -> tuple[config.Config, catalog.Catalog, list[plan.Case]]:
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
    from freepath import run
    from freepath.device import open_devices
    from freepath.results import ResultFolder

    devices = open_devices(options.device)
    clock = run.Clock(started)
    path = options.output or run.folder_of(loaded.name, resume=options.resume)
    folder = ResultFolder(path, resume=options.resume)
    console = _console(stderr=options.json)
    with _progress(console) as bar:
        task = bar.add_task("", total=len(cases) * len(devices))

        def on_done(row: dict[str, Any]) -> None:
            if not console.is_terminal:
                line = f"{row['status']:>8}  {row['case']}"
                console.print(line, highlight=False, markup=False, soft_wrap=True)

        def on_progress(done: float, total: int) -> None:
            bar.update(task, completed=done, total=total)

        sweep = run.Run(loaded, known, cases, folder, clock, on_done, on_progress)
        try:
            sweep.execute(devices)
        except KeyboardInterrupt:
            bar.stop()
            _say_how_to_resume(options, sweep, path)
            return INTERRUPTED
    return _report(options, console, sweep, folder, clock)


def _progress(console: Console) -> Progress:
    columns = (
        TextColumn("{task.completed:.0f}/{task.total:.0f} cases"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(elapsed_when_finished=False),
    )
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def _say_how_to_resume(options: Namespace, sweep: Any, path: Any) -> None:
    print(
        f"freepath: interrupted with {sweep.ended} of {sweep.total} cases done; go on with the same "
        f"command and -o {path} --resume",
        file=sys.stderr,
    )


def _report(
    options: Namespace, console: Console, sweep: Any, folder: Any, clock: Any
) -> int:
    from freepath import environment, run, table

    order = {case.case_id: case.index for case in sweep.cases}
    rows = sorted(folder.rows(), key=lambda row: order[row["case_id"]])
    failed = run.failures(rows)
    if options.json:
        print(json.dumps(table.records(rows), indent=1))
    else:
        for device, members in table.by_device(rows).items():
            console.print(f"{device}\n{environment.processor()}, load {environment.load()}")
            for group in table.groups(members):
                console.print("", table.table_of(group))
        _print_skipped(console, rows)
        console.print(
            f"\n{table.LEGEND}\n\ndevice time {100 * clock.device_share:.0f} % of "
            f"{clock.wall_s - clock.build_s:.1f} s outside compilation; "
            f"compilation {clock.build_s:.1f} s",
            highlight=False,
        )
        for path in folder.paths():
            console.print(f"wrote {path}", highlight=False, soft_wrap=True)
    for row in failed:
        print(f"freepath: {row['status']}: {row['case']}: {row['reason']}", file=sys.stderr)
    return FAILED if failed else 0


def _print_skipped(console: Console, rows: list[dict[str, str]]) -> None:
    reasons = Counter(row["reason"] for row in rows if row["status"] == "skipped")
    for reason, count in reasons.items():
        cases = "1 case" if count == 1 else f"{count} cases"
        console.print(f"skipped {cases}: {reason}", highlight=False, markup=False)


def _show_only(options: Namespace, cases: list[plan.Case]) -> int:
    if options.json:
        print(json.dumps([case.identity() | {"name": case.name} for case in cases], indent=1))
        return 0
    for case in cases:
        reason = f"  (skipped: {case.skip_reason})" if case.skip_reason else ""
        print(f"{case.index:>5}  {case.name}{reason}")
    print(f"\n{len(cases)} cases")
    return 0


def _source(options: Namespace) -> int:
    loaded, known, cases = _cases(options)
    if options.case is not None:
        cases = [case for case in cases if case.index == options.case]
        if not cases:
            problem = f"expected the number of a case (see `freepath run {options.config} -N`)"
            raise ConfigError([Problem(f"--case {options.case}", 0, 0, "", problem)])
    elif len(cases) > 1:
        problem = f"expected --case N: {len(cases)} cases match"
        raise ConfigError([Problem(options.config, 0, 0, "", problem)])
    from freepath import run, source, sweep
    from freepath.device import open_devices

    case = cases[0]
    if case.skip_reason:
        print(f"freepath: {case.name} has no source: {case.skip_reason}", file=sys.stderr)
        return USAGE
    device = open_devices(options.device)[0]
    medium = run.build_media([case], run.search_path(loaded))
    structure = sweep.structure_of(case, known, *medium.values(), device, count=False)
    print(source.compose(structure).text)
    return 0


def _list(options: Namespace) -> int:
    records = listing.records_of(options.what, catalog.load(options.trackers))
    return _print_records(records, as_json=options.json)


def _devices(options: Namespace) -> int:
    from freepath.device import device_records

    records = device_records()
    if not records and not options.json:
        print("no OpenCL device found; `pip install freepath[pocl]` brings one that runs on the CPU")
        return 0
    return _print_records(records, as_json=options.json)


def _print_records(records: list[dict[str, Any]], *, as_json: bool) -> int:
    if as_json:
        print(json.dumps(records, indent=1, default=str))
    else:
        _console().print(listing.table_of(records))
    return 0


def _console(*, stderr: bool = False) -> Console:
    """A console; one that is no terminal has no width that a table should be folded to."""
    console = Console(stderr=stderr)
    return console if console.is_terminal else Console(stderr=stderr, width=160)
