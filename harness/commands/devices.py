"""`freepath devices`: what OpenCL finds, with each known driver in a process of its own."""

from __future__ import annotations

import dataclasses
import json
import sys
from argparse import Namespace
from typing import Any

from freepath.commands.common import print_records


def add(commands: Any) -> None:
    """Declare its arguments."""
    devices = commands.add_parser(
        "devices",
        help="list the OpenCL devices",
        description="List the OpenCL devices, and the known drivers that are not installed; -d of "
        "the other commands takes part of a name, or what stands behind -d here.",
        allow_abbrev=False,
    )
    devices.add_argument("--json", action="store_true", help="as JSON")


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath import drivers
    from freepath.device import NO_DEVICE, list_devices

    if drivers.current() and options.json:  # asked by `selection.probe`
        print(json.dumps([dataclasses.asdict(info) for info in list_devices()], indent=1))
        return 0
    records = _records()
    if all("missing" in record for record in records) and not options.json:
        print(f"freepath: {NO_DEVICE}", file=sys.stderr)
    return print_records(records, as_json=options.json)


def _records() -> list[dict[str, Any]]:
    """The devices of each driver, or what is missing; those of no known driver come last."""
    from freepath import drivers, listing, selection
    from freepath.device import list_devices

    wanted = selection.everywhere(list_devices())
    found = dict(zip(wanted, selection.probe(wanted), strict=True))
    records = []
    for driver in (*drivers.DRIVERS, drivers.OTHERS):
        records += listing.devices(found.get(driver, []), driver.name)
        if driver is not drivers.OTHERS and not found.get(driver):
            missing = driver.missing or "installed, but its process shows no device"
            records.append(listing.not_there(driver.name, driver.title, missing))
    return records
