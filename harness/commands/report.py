"""`freepath report`: a result as a picture."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

import shtab


def add(commands: Any) -> None:
    """Declare its arguments."""
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


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath import report

    print(f"wrote {report.write(options.result, options.output)}")
    return 0
