"""`freepath check`: whether a device computes what it should."""

from __future__ import annotations

import argparse
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shtab

from freepath.commands.arguments import add_device, add_trackers
from freepath.errors import FAILED, INTERRUPTED, DeviceError, NothingMatchedError

if TYPE_CHECKING:
    from freepath.checks.model import Check
    from freepath.checks.session import Session
    from freepath.device.selection import Parts

FOR_CTEST = ("timeout", "arithmetic", "storage", "device", "trackers", "seed")
FOR_DRIVERS = (
    *("parallel", "timeout", "repeat", "arithmetic", "storage", "trackers", "seed"),
    *("label_regex", "label_exclude", "tests_regex", "exclude_regex"),
    *("verbose", "rerun_failed", "stop_on_failure", "output_on_failure"),
)
"""What the process of a driver is given again, beside its devices."""


def add(commands: Any) -> None:
    """Declare its arguments."""
    check = commands.add_parser(
        "check",
        help="check that a device computes what it should",
        description="Run checks with a known error budget on devices; flags and text are ctest's.",
        allow_abbrev=False,
    )
    add_argument = check.add_argument

    def flag(*names: str, help: str) -> None:  # noqa: A002 (as argparse calls it)
        add_argument(*names, action="store_true", help=help)

    def labels(*names: str, help: str) -> None:  # noqa: A002
        add_argument(*names, action="append", default=[], metavar="RE", help=help)

    def given(name: str, kind: Any, metavar: str, help: str, default: Any = None) -> Any:  # noqa: A002
        return add_argument(name, type=kind, metavar=metavar, default=default, help=help)

    flag("-N", "--show-only", help="list the checks and stop")
    flag("-V", "--verbose", help="say what each check guards against, and all that it says")
    add_argument("-R", "--tests-regex", metavar="RE", help="only checks whose name matches")
    add_argument("-E", "--exclude-regex", metavar="RE", help="no checks whose name matches")
    labels("-L", "--label-regex", help="only checks with a label that matches; of several, all")
    labels("-LE", "--label-exclude", help="no checks with a label that matches")
    flag("--rerun-failed", help="those that failed last time")
    add_argument(
        "-j", "--parallel", type=_count, default=1, metavar="N", help="N processes (default: 1)"
    )
    text = "stop a check that takes longer (default: 300)"
    given("--timeout", _seconds, "SECONDS", text, 300.0)
    flag("--stop-on-failure", help="stop at the first that fails")
    flag("--output-on-failure", help="what was measured where a check fails")
    given("--output-junit", Path, "FILE", "write results as JUnit XML").complete = shtab.FILE
    text = "run all N times with fresh seeds, and estimate the rate of false alarms"
    given("--repeat", _count, "N", text, 1)
    given("--seed", _seed, "N", "another seed than the usual")
    for name, usual, other, of in (
        ("arithmetic", "strict", "fast", "what kernels are built with"),
        ("storage", "float", "half", "how voxels are stored"),
    ):
        text = f"{of} where a check does not say; {other}: see what that breaks"
        add_argument(f"--{name}", choices=[usual, other], default=usual, help=text)
    text = "write DIR/CTestTestfile.cmake, so that ctest runs these checks, and stop"
    given("--ctest", Path, "DIR", text).complete = shtab.DIRECTORY
    # given to the process of a driver: who started it shows them all
    given("--outcomes", Path, "FILE", argparse.SUPPRESS)
    add_device(check, "part of the name, platform or driver of a device, or 'all'; may be repeated")
    add_trackers(check)


def _number(kind: Callable[[str], Any], holds: Callable[[Any], bool], what: str) -> Any:
    """A type of an argument: what `kind` reads of it, where that holds."""

    def read(text: str) -> Any:
        try:
            value = kind(text)
        except ValueError:
            value = -1
        if not holds(value):
            raise argparse.ArgumentTypeError(f"expected {what}, got '{text}'")
        return value

    return read


def _whole(text: str) -> int:
    return int(text) if text.isascii() and text.isdigit() else -1


_count = _number(_whole, lambda n: 1 <= n <= 100_000, "an integer from 1 to 100000")
_seed = _number(_whole, lambda n: 0 <= n < 2**53, "an integer from 0 to 2^53 - 1")
_seconds = _number(float, lambda s: 0.0 < s <= 1e6, "seconds above 0, at most 1e6")


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.checks import files, printing

    chosen = _chosen(options)
    if options.show_only:
        print(f"Test project {Path.cwd()}")
        print(printing.listing(chosen, verbose=options.verbose))
        return 0
    if options.ctest:
        again = ["--output-on-failure", *_again(options, FOR_CTEST)]
        print(f"wrote {files.write_ctest(options.ctest, chosen, again, options.timeout)}")
        return 0
    return _run(options, chosen)


def _chosen(options: Namespace) -> list[tuple[int, Check]]:
    from freepath.checks import files, registry
    from freepath.compose import catalog

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


def _again(options: Namespace, names: tuple[str, ...]) -> list[str]:
    """The arguments that say these options again, from whatever folder."""

    def words() -> Iterator[str]:
        for name in names:
            value, flag = getattr(options, name), f"--{name.replace('_', '-')}"
            for one in value if isinstance(value, list) else [value]:
                if one is True:
                    yield flag
                elif one is not None and one is not False:
                    yield from (flag, str(one.resolve() if isinstance(one, Path) else one))

    return list(words())


def _run(options: Namespace, chosen: list[tuple[int, Check]]) -> int:
    from freepath.checks import everywhere, files, repeats, session
    from freepath.device import selection

    parts = selection.resolve(options.device)
    here = selection.can_be_here(parts)
    infos = parts[0].infos if here else []
    running = session.Session(chosen, session.Options.of(options), _tell)
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
    from freepath.checks import printing, repeats

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
    from freepath.checks import everywhere

    unusable: list[str] = []
    again = _again(options, FOR_DRIVERS)
    for outcomes, messages, code in everywhere.run(parts, again, _tell):
        running.outcomes |= outcomes
        unusable += messages
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        if options.stop_on_failure and (running.failed or unusable):
            break
    return unusable


def _run_on(running: Session, info: Any) -> list[str]:
    """Run all on a device and print a summary; returns why it could not be used, if so."""
    from freepath.checks import printing

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
