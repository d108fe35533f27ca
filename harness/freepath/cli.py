"""The command `freepath`."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import shtab

from freepath import __version__
from freepath.commands import (
    ab,
    check,
    compare,
    devices,
    explain,
    export,
    listing,
    merge,
    new_tracker,
    recommend,
    report,
    run,
    schema,
    source,
    trying,
    volume,
    worker,
)
from freepath.commands.common import let_go_of_output
from freepath.errors import FAILED, INTERRUPTED, FreepathError, printable

COMMANDS = {
    "run": run,
    "volume": volume,
    "check": check,
    "recommend": recommend,
    "try": trying,
    "new-tracker": new_tracker,
    "merge": merge,
    "report": report,
    "compare": compare,
    "ab": ab,
    "export": export,
    "source": source,
    "schema": schema,
    "list": listing,
    "explain": explain,
    "worker": worker,
    "devices": devices,
}

EPILOG = """\
exit codes: 0 fine; 1 a regression; 2 usage or config; 5 nothing matched; 8 a case or check
failed; 130 interrupted

examples:
  freepath run quick                        the sweep that ships for a first look
  freepath run quick -N                     its cases, without running them
  freepath run my.yaml -a tightness=1,2,4   another axis from the command line
  freepath run my.yaml -R delta -E grid     only cases named delta, none named grid
  freepath run my.yaml -o out --resume      go on where an interrupted run stopped
  freepath list trackers                    what can be compared
  freepath explain tightness                what a word of the table means
  freepath report out                       one HTML file of it, to look at
  freepath compare before after             what became slower, noisier or different
  freepath check -L fast -j 2               does this device compute what it should?
  freepath volume cloud.vdb --sigma-t 0.05  what is in a volume of one's own
  freepath recommend cloud.vdb --accuracy 1%   what to use in a volume of one's own
  freepath try my_tracker.cl                is a new tracker right, and where does it pay?
  freepath source quick --case 3            the OpenCL C that case 3 runs
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code. A user's mistake is a message, never a traceback."""
    if hasattr(sys.stdout, "reconfigure"):  # of a terminal without a plus-minus
        sys.stdout.reconfigure(errors="backslashreplace")
    options = parser().parse_args(arguments)
    command = COMMANDS[options.command].execute
    try:
        with _terminated_like_interrupted():
            code = command(options)
            sys.stdout.flush()
        return code
    except FreepathError as error:
        print(printable(f"freepath: {error}"), file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("freepath: interrupted", file=sys.stderr)
        return INTERRUPTED
    except MemoryError:
        print("freepath: out of memory", file=sys.stderr)
        return FAILED
    except BrokenPipeError:
        let_go_of_output()  # the reader of a pipe has seen enough
        return 0
    except OSError as error:  # a full disk, of which standard output may be one
        let_go_of_output()
        told = f"freepath: {error.filename or 'writing'}: {error.strerror}"
        print(printable(told), file=sys.stderr)
        return FAILED


def parser() -> argparse.ArgumentParser:
    """Build the parser of `freepath`."""
    top = argparse.ArgumentParser(
        prog="freepath",
        description="What accuracy costs in time: samplers of distance and transmittance in "
        "participating media, measured on OpenCL devices.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"freepath {__version__}")
    shtab.add_argument_to(
        top, "--print-completion", help="print a completion script for this shell and exit"
    )
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for module in COMMANDS.values():
        module.add(commands)
    return top


@contextmanager
def _terminated_like_interrupted() -> Iterator[None]:
    """Let SIGTERM and a closed terminal do what Ctrl-C does: all is left in order.

    A signal that is ignored, as by nohup, stays so.
    """

    def interrupt(signum: int, frame: Any) -> None:
        raise KeyboardInterrupt

    numbers = (signal.SIGTERM, signal.SIGHUP)
    taken = [one for one in numbers if signal.getsignal(one) is not signal.SIG_IGN]
    before = {one: signal.signal(one, interrupt) for one in taken}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
