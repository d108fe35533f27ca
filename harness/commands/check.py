"""`freepath check`: whether a device computes what it should."""

from __future__ import annotations

import argparse
import sys
import time
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shtab
from freepath.arguments import add_device, add_trackers
from freepath.errors import FAILED, INTERRUPTED, DeviceError, NothingMatchedError

if TYPE_CHECKING:
    from freepath.check.model import Check
    from freepath.check.session import Session
    from freepath.selection import Parts


def add(commands: Any) -> None:
    """Declare its arguments."""
    check = commands.add_parser(
        "check",
        help="check that a device computes what it should",
        description="Run checks with a known error budget on devices; flags and text are ctest's.",
        allow_abbrev=False,
    )
    _add_selection(check)
    _add_running(check)
    add_device(check, "part of the name, platform or driver of a device, or 'all'; may be repeated")
    add_trackers(check)


def _add_selection(check: Any) -> None:
    check.add_argument("-N", "--show-only", action="store_true", help="list the checks and stop")
    check.add_argument(
        "-V",
        "--verbose",
        action="store_true",
        help="say what each check guards against, and all that it says",
    )
    check.add_argument("-R", "--tests-regex", metavar="RE", help="only checks whose name matches")
    check.add_argument("-E", "--exclude-regex", metavar="RE", help="no checks whose name matches")
    check.add_argument(
        "-L",
        "--label-regex",
        action="append",
        default=[],
        metavar="RE",
        help="only checks with a label that matches; given twice, both must",
    )
    check.add_argument(
        "-LE",
        "--label-exclude",
        action="append",
        default=[],
        metavar="RE",
        help="no checks with a label that matches",
    )
    check.add_argument("--rerun-failed", action="store_true", help="those that failed last time")


def _add_running(check: Any) -> None:
    check.add_argument(
        "-j", "--parallel", type=_count, default=1, metavar="N", help="so many processes"
    )
    check.add_argument(
        "--timeout",
        type=_seconds,
        default=300.0,
        metavar="SECONDS",
        help="stop a check that takes longer (default: 300)",
    )
    check.add_argument(
        "--stop-on-failure", action="store_true", help="stop at the first that fails"
    )
    check.add_argument(
        "--output-on-failure", action="store_true", help="what was measured where a check fails"
    )
    check.add_argument(
        "--output-junit", type=Path, metavar="FILE", help="write results as JUnit XML"
    ).complete = shtab.FILE
    check.add_argument(
        "--repeat",
        type=_count,
        default=1,
        metavar="N",
        help="run all N times with fresh seeds, and estimate the rate of false alarms",
    )
    check.add_argument("--seed", type=_seed, metavar="N", help="another seed than the usual")
    check.add_argument(
        "--arithmetic",
        choices=["strict", "fast"],
        default="strict",
        help="what kernels are built with where a check does not say; fast: see what it breaks",
    )
    check.add_argument(
        "--storage",
        choices=["float", "half"],
        default="float",
        help="how voxels are stored where a check does not say; half: see what that breaks",
    )
    check.add_argument(
        "--ctest",
        type=Path,
        metavar="DIR",
        help="write DIR/CTestTestfile.cmake, so that ctest runs these checks, and stop",
    ).complete = shtab.DIRECTORY
    # given to the process of a driver: who started it shows them all
    check.add_argument("--outcomes", type=Path, help=argparse.SUPPRESS)


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 100_000:
        raise argparse.ArgumentTypeError(f"expected an integer from 1 to 100000, got '{text}'")
    return int(text)


def _seed(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) >= 2**53:
        raise argparse.ArgumentTypeError(f"expected an integer from 0 to 2^53 - 1, got '{text}'")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 1e6:
        raise argparse.ArgumentTypeError(f"expected seconds above 0, at most 1e6, got '{text}'")
    return value


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.check import files, printing

    chosen = _chosen(options)
    if options.show_only:
        print(f"Test project {Path.cwd()}")
        print(printing.listing(chosen, verbose=options.verbose))
        return 0
    if options.ctest:
        path = files.write_ctest(options.ctest, chosen, _handed_on(options), options.timeout)
        print(f"wrote {path}")
        return 0
    return _run(options, chosen)


def _chosen(options: Namespace) -> list[tuple[int, Check]]:
    from freepath import catalog
    from freepath.check import files, registry

    selection = registry.Selection(
        options.tests_regex, options.exclude_regex, options.label_regex, options.label_exclude
    )
    chosen = selection.of(registry.checks(catalog.load(options.trackers)))
    if options.rerun_failed:
        failed = files.failed_last()
        chosen = [(number, check) for number, check in chosen if check.name in failed]
        if not chosen:
            raise NothingMatchedError("no tests matched: none of these failed last time")
    return chosen


def _handed_on(options: Namespace) -> list[str]:
    """The arguments that ctest passes to each check."""
    handed = ["--output-on-failure", "--timeout", f"{options.timeout:g}"]
    handed += ["--arithmetic", options.arithmetic, "--storage", options.storage]
    for device in options.device:
        handed += ["-d", device]
    for folder in options.trackers:
        handed += ["--trackers", str(folder.resolve())]
    return handed if options.seed is None else [*handed, "--seed", str(options.seed)]


def _run(options: Namespace, chosen: list[tuple[int, Check]]) -> int:
    from freepath import selection
    from freepath.check import everywhere, files, repeats, session

    parts = selection.resolve(options.device)
    here = selection.can_be_here(parts)
    infos = parts[0].infos if here else []
    running = session.Session(
        chosen,
        session.Options(
            processes=options.parallel,
            timeout=options.timeout,
            repeat=options.repeat,
            seed=options.seed,
            trackers=options.trackers,
            arithmetic=options.arithmetic,
            storage=options.storage,
            stop_on_failure=options.stop_on_failure,
            output_on_failure=options.output_on_failure,
            verbose=options.verbose,
        ),
        _tell,
    )
    # a file that cannot be written is told before hours of checks, not after
    files.write_junit(options.output_junit, running.outcomes)
    unusable: list[str] = []
    try:
        if not here:
            unusable += _run_in_processes(options, parts, running)
        for info in infos:
            unusable += _run_on(running, info)
    except KeyboardInterrupt:
        if options.repeat > 1 and not options.outcomes:
            text, _ = repeats.of_devices(running.outcomes, options.repeat, stopped=True)
            print(f"\n{text}", flush=True)
        raise
    finally:
        # also after Ctrl-C: what is known is kept
        if options.outcomes:
            everywhere.write(options.outcomes, running.outcomes, unusable)
        else:
            files.keep_failed(running.failed)
        files.write_junit(options.output_junit, running.outcomes)
    return _judge(options, running, unusable)


def _judge(options: Namespace, running: Session, unusable: list[str]) -> int:
    """Print what is to be said of all devices together; returns the exit code."""
    from freepath.check import printing, repeats

    failed = FAILED if running.failed or unusable else 0
    if options.outcomes:
        return failed
    if len(running.outcomes) > 1:
        print(f"\n{printing.matrix(running.outcomes)}")
    for message in unusable:
        print(f"freepath: {message}", file=sys.stderr)
    if options.repeat > 1:
        stopped = bool(options.stop_on_failure and failed)
        text, too_many = repeats.of_devices(running.outcomes, options.repeat, stopped=stopped)
        print(f"\n{text}")
        return FAILED if too_many or stopped else 0
    if running.failed:
        print("Errors while running freepath check", file=sys.stderr)
        if not options.output_on_failure:
            hint = 'Use "--rerun-failed --output-on-failure" to see what was measured.'
            print(hint, file=sys.stderr)
    return failed


def _tell(line: str) -> None:
    print(line, flush=True)


def _run_in_processes(options: Namespace, parts: Parts, running: Session) -> list[str]:
    """Run all on each driver's devices, in its process; returns what could not be used."""
    from freepath.check import everywhere

    unusable: list[str] = []
    for outcomes, messages, code in everywhere.run(parts, _for_drivers(options), _tell):
        running.outcomes |= outcomes
        unusable += messages
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        if options.stop_on_failure and (running.failed or unusable):
            break
    return unusable


def _for_drivers(options: Namespace) -> list[str]:
    """The arguments that the process of a driver gets, without its devices."""
    arguments = ["-j", str(options.parallel), "--timeout", f"{options.timeout:g}"]
    arguments += ["--repeat", str(options.repeat)]
    arguments += ["--arithmetic", options.arithmetic, "--storage", options.storage]
    lists = {"-L": options.label_regex, "-LE": options.label_exclude, "--trackers": []}
    lists["--trackers"] = [str(folder.resolve()) for folder in options.trackers]
    lists |= {"-R": [options.tests_regex], "-E": [options.exclude_regex], "--seed": [options.seed]}
    for flag, values in lists.items():
        arguments += [word for value in values if value is not None for word in (flag, str(value))]
    flags = ("verbose", "rerun_failed", "stop_on_failure", "output_on_failure")
    return arguments + [f"--{flag.replace('_', '-')}" for flag in flags if getattr(options, flag)]


def _run_on(running: Session, info: Any) -> list[str]:
    """Run all on a device and print a summary; returns why it could not be used, if so."""
    from freepath.check import printing

    print(f"Test project {Path.cwd()}\n    Device {info.label}", flush=True)
    started = time.perf_counter()
    try:
        running.run(info)
    except DeviceError as error:
        return [f"{info.label}: {error}"]
    finally:
        ended = running.outcomes.get(info.label)
        if ended:
            print(printing.summary(ended, time.perf_counter() - started), flush=True)
    return []
