"""The command line's grammar."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import shtab
from freepath.version import __version__

LISTS = ("trackers", "media", "majorants", "effects", "configs")
EPILOG = """\
exit codes: 0 fine; 2 usage or config; 5 nothing matched; 8 a case failed; 130 interrupted

examples:
  freepath run quick                        the sweep that ships for a first look
  freepath run quick -N                     its cases, without running them
  freepath run my.yaml -a tightness=1,2,4   another axis from the command line
  freepath run my.yaml -R delta -E grid     only cases named delta, none named grid
  freepath run my.yaml -o out --resume      go on where an interrupted run stopped
  freepath list trackers                    what can be compared
  freepath report out -o picture.png        its errors over device time, as a picture
  freepath source quick --case 3            the OpenCL C that case 3 runs
"""


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
    _add_run(commands)
    _add_report(commands)
    _add_source(commands)
    _add_list(commands)
    _add_devices(commands)
    return top


def _add_run(commands: Any) -> None:
    run = commands.add_parser(
        "run",
        help="run a sweep",
        description="Run the cases of a config, print a table and write summary.csv, samples.csv "
        "and run.json.",
        allow_abbrev=False,
    )
    _add_config(run)
    _add_device(run, "part of the name, platform or driver of a device, or 'all'; may be repeated")
    run.add_argument("-N", "--show-only", action="store_true", help="list the cases and stop")
    run.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="folder for the results (default: results/NAME-TIME)",
    ).complete = shtab.DIRECTORY
    run.add_argument(
        "--resume",
        action="store_true",
        help="go on with the run in DIR (default: the newest of this config): rows whose config, "
        "source, device and driver are unchanged are kept",
    )
    run.add_argument("--json", action="store_true", help="print the rows as JSON, nothing else")


def _add_config(command: Any) -> None:
    command.add_argument(
        "config", metavar="CONFIG", help="a YAML file, or the name of a shipped config"
    ).complete = shtab.FILE
    command.add_argument(
        "-a",
        "--axis",
        action="append",
        default=[],
        metavar="AXIS=V1,V2",
        help="replace an axis of the matrix, e.g. tightness=1,2 or 'tracker=delta,{march: {step: "
        "0.1}}'; may be repeated",
    )
    command.add_argument("-R", "--include", metavar="RE", help="only cases whose name matches")
    command.add_argument("-E", "--exclude", metavar="RE", help="no cases whose name matches")
    _add_trackers(command)


def _add_device(command: Any, what: str) -> None:
    command.add_argument(
        "-d",
        "--device",
        action="append",
        default=[],
        metavar="DEVICE",
        help=f"{what} (default: the first; see `freepath devices`)",
    )


def _add_trackers(command: Any) -> None:
    command.add_argument(
        "--trackers",
        action="append",
        default=[],
        type=Path,
        metavar="DIR",
        help="a folder with further trackers, one .cl file each; may be repeated",
    ).complete = shtab.DIRECTORY


def _add_report(commands: Any) -> None:
    report = commands.add_parser(
        "report",
        help="draw what accuracy costs in time",
        description="Draw the RMSE of every case of a result over device time, as .svg or .png.",
        allow_abbrev=False,
    )
    report.add_argument(
        "result", type=Path, metavar="RESULT", help="the folder of a run"
    ).complete = shtab.DIRECTORY
    report.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("report.svg"),
        metavar="FILE",
        help="where to draw it (default: report.svg)",
    ).complete = shtab.FILE


def _add_source(commands: Any) -> None:
    source = commands.add_parser(
        "source",
        help="show the OpenCL C of a case",
        description="Print the OpenCL C that a case is composed of, as its device builds it.",
        allow_abbrev=False,
    )
    _add_config(source)
    source.add_argument("--case", type=int, metavar="N", help="number of the case in `run -N`")
    _add_device(source, "a device whose lanes `auto` stands for")


def _add_list(commands: Any) -> None:
    listing = commands.add_parser(
        "list",
        help="list trackers, media, majorants, effects or configs",
        description="List what a config may name, and the configs that come with freepath.",
        allow_abbrev=False,
    )
    listing.add_argument(
        "what", nargs="?", choices=LISTS, default=LISTS[0], help="trackers if none"
    )
    listing.add_argument("--json", action="store_true", help="as JSON")
    _add_trackers(listing)


def _add_devices(commands: Any) -> None:
    devices = commands.add_parser(
        "devices",
        help="list the OpenCL devices",
        description="List the OpenCL devices; -d of the other commands takes part of a name.",
        allow_abbrev=False,
    )
    devices.add_argument("--json", action="store_true", help="as JSON")
