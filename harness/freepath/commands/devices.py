"""`freepath devices`: which drivers there are, which of them work here, which is the default."""

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
        description="Try each OpenCL driver in a process of its own, and list what works, in the "
        "order in which freepath chooses. -d of the other commands takes part of a device's name, "
        "or what stands behind -d here.",
        allow_abbrev=False,
    )
    devices.add_argument("--json", action="store_true", help="as JSON")


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.device import drivers, icd, trial
    from freepath.show import listing

    tried = trial.of_installed(afresh=True)
    chosen = next((driver for driver, outcome in tried.items() if outcome.working), None)
    records = []
    for driver in drivers.in_order():
        outcome = tried.get(driver)
        if outcome is None:
            if driver is not drivers.OTHERS:
                records.append(listing.not_there(driver, driver.missing))
        elif not outcome.devices:
            records.append(listing.not_there(driver, f"cannot be used: {outcome.failure}"))
        else:
            records += listing.devices(driver, outcome, is_default=driver is chosen)
    for file, library in icd.strangers().items():
        if not icd.is_there(library):
            what = f"{file} names {library}, which is not there: install it, or remove the file"
            records.append({"device": file.name, "missing": what})
    if chosen is None:
        print("freepath: no OpenCL driver works here", file=sys.stderr)
    return print_records(records, as_json=options.json)
