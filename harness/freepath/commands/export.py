"""`freepath export`: a result in the format of another tool."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

import shtab

from freepath.commands.arguments import expression

FORMATS = ("bmf", "github-action-benchmark", "google-benchmark", "t4", "pyperf")


def add(commands: Any) -> None:
    """Declare its arguments."""
    export = commands.add_parser(
        "export",
        help="write a result in the format of another tool",
        description="Write the times of a result as JSON: in Bencher's metric format (bmf), for "
        "github-action-benchmark (customSmallerIsBetter), as Google Benchmark, as results of "
        "auto-tuning (T4 of Kernel Tuner) or for pyperf. What cannot be written is named on "
        "stderr.",
        allow_abbrev=False,
    )
    export.add_argument(
        "result", type=Path, metavar="RESULT", help="the folder of a run"
    ).complete = shtab.DIRECTORY
    export.add_argument("--format", choices=FORMATS, required=True, help="whose format")
    export.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="where to write it (default: print it)"
    ).complete = shtab.FILE
    told = "only cases whose name matches"
    export.add_argument("--only", type=expression, default="", metavar="RE", help=told)


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.errors import FreepathError
    from freepath.show.export import exported

    text, left_out = exported(options.result, options.format, options.only)
    if options.output:
        try:
            options.output.write_text(text, encoding="utf-8")
        except OSError as error:
            raise FreepathError(f"cannot write {options.output}: {error.strerror}") from error
        print(f"wrote {options.output}")
    else:
        print(text, end="")
    for one in left_out:
        print(f"freepath: left out: {one}", file=sys.stderr)
    return 0
