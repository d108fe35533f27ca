"""`freepath schema`: the JSON Schema of configs, from which editors complete."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from freepath.commands.arguments import add_trackers


def add(commands: Any) -> None:
    """Declare its arguments."""
    command = commands.add_parser(
        "schema",
        help="print the JSON Schema of configs, for editors",
        description="Print the JSON Schema of configs. It knows the trackers of --trackers too.",
        allow_abbrev=False,
    )
    command.add_argument("-o", "--output", type=Path, metavar="FILE", help="write it to a file")
    add_trackers(command)


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.compose import catalog
    from freepath.config import schema
    from freepath.errors import ConfigError, Problem

    text = schema.text(catalog.load(options.trackers).parameter_models())
    if options.output is None:
        sys.stdout.write(text)
        return 0
    try:
        options.output.write_text(text, "utf-8")
    except OSError as error:
        message = f"expected a file that can be written: {error.strerror}"
        raise ConfigError([Problem(str(options.output), 0, 0, "", message)]) from None
    return 0
