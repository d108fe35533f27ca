"""`freepath worker`: measure what `freepath run --cluster` sends."""

from __future__ import annotations

import sys
from argparse import Namespace
from typing import Any

from freepath.commands.arguments import add_device
from freepath.errors import DeviceError


def add(commands: Any) -> None:
    """Declare its arguments."""
    worker = commands.add_parser(
        "worker",
        help="measure what `run --cluster` sends",
        description="Announce OpenCL devices of this machine to dask's scheduler, and measure the "
        "cases that `freepath run --cluster ADDRESS` sends, one at a time.",
        allow_abbrev=False,
    )
    worker.add_argument("address", metavar="ADDRESS", help="of the scheduler: tcp://HOST:PORT")
    add_device(worker, "part of the name, platform or driver of a device, or 'all'")
    worker.add_argument(
        "--host",
        default="",
        metavar="HOST",
        help="listen on this address (default: 127.0.0.1, for a scheduler on this machine)",
    )


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.device import selection
    from freepath.measure import cluster

    parts = selection.checked(selection.resolve(options.device))
    for part in parts:
        if part.failure:
            print(f"freepath: {part.driver.name} is not used: {part.failure}", file=sys.stderr)
    usable = [part for part in parts if not part.failure]
    if not usable:
        raise DeviceError("no device of this machine can be used")
    for info in (info for part in usable for info in part.infos):
        print(f"{options.address}: {info.label}", flush=True)
    cluster.serve(options.address, usable, options.host)
    return 0
