"""`freepath merge`: the results of several runs of a config in one folder."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

import shtab


def add(commands: Any) -> None:
    """Declare its arguments."""
    merge = commands.add_parser(
        "merge",
        help="join results, such as the shards of a sweep",
        description="Write the rows of several results of one config, and what belongs to them, "
        "into a new folder. Refuses results that have a row of the same case on the same device.",
        allow_abbrev=False,
    )
    merge.add_argument(
        "results", nargs="+", type=Path, metavar="RESULT", help="folder of a run"
    ).complete = shtab.DIRECTORY
    merge.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="the new folder"
    ).complete = shtab.DIRECTORY


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.results import folder as results
    from freepath.results.merging import merge

    for told in merge(options.results, options.output):
        print(f"freepath: {told}", file=sys.stderr)
    rows = len(results.read_rows(options.output / results.SUMMARY))
    print(f"wrote {options.output}: {rows} rows of {len(options.results)} results")
    return 0
