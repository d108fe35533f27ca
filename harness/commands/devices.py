"""`freepath devices`: what OpenCL finds."""

from __future__ import annotations

import sys
from argparse import Namespace
from typing import Any

from freepath.commands.common import print_records


def add(commands: Any) -> None:
    """Declare its arguments."""
    devices = commands.add_parser(
        "devices",
        help="list the OpenCL devices",
        description="List the OpenCL devices; -d of the other commands takes part of a name.",
        allow_abbrev=False,
    )
    devices.add_argument("--json", action="store_true", help="as JSON")


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath import listing
    from freepath.device import NO_DEVICE, list_devices

    records = listing.devices(list_devices())
    if not records and not options.json:
        print(f"freepath: {NO_DEVICE}", file=sys.stderr)
    return print_records(records, as_json=options.json)
