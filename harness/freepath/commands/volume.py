"""`freepath volume`: what is in a file, how dense it is, and how to use it."""

from __future__ import annotations

import argparse
import json
import shlex
from argparse import Namespace
from pathlib import Path
from typing import Any

import shtab

from freepath.commands.arguments import add_sigma_t, add_volume, positive


def add(commands: Any) -> None:
    """Declare its arguments."""
    volume = commands.add_parser(
        "volume",
        help="say what is in a volume, and how to use it",
        description="Say what is in a file: grids, type, box, range, empty space, optical depths, "
        "memory, which grid of majorants is the least work, a picture, and the lines of a config "
        "that use it.",
        allow_abbrev=False,
    )
    add_volume(volume)
    add_sigma_t(volume)
    volume.add_argument(
        "--voxel-size",
        type=_sides,
        metavar="X[,Y,Z]",
        help="sides of a voxel; overrides what the file says (which is 1 where it says nothing)",
    )
    volume.add_argument(
        "--along",
        choices=("x", "y", "z"),
        help="axis of the voxels that the picture looks along (default: the shortest)",
    )
    volume.add_argument(
        "-o", "--output", type=Path, metavar="FILE.png", help="write the picture into a file too"
    ).complete = shtab.FILE
    volume.add_argument("--json", action="store_true", help="print JSON, without a picture")


def _sides(text: str) -> list[float]:
    sides = [positive(part) for part in text.split(",")]
    if len(sides) not in (1, 3):
        raise argparse.ArgumentTypeError(f"expected one or three numbers, got '{text}'")
    return sides * (3 // len(sides))


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.commands.common import console_of
    from freepath.errors import UsageError
    from freepath.extras import contents
    from freepath.extras.given import volume_of

    path = options.output
    if path and path.suffix.lower() != ".png":
        raise UsageError(f"{path}: expected a name that ends in .png")
    volume, keys = volume_of(options.volume, options.sigma_t, grid=options.grid, raw=options.raw)
    if options.voxel_size:
        keys["voxel_size"] = options.voxel_size
    found = contents.Contents(volume, keys)
    facts = found.facts()
    depths, pixel, axis = found.projection(options.along)
    if path:
        contents.write_png(depths, pixel, path)
    if options.json:
        print(json.dumps(facts, indent=1))
        return 0
    for line in contents.text(facts):
        print("".join(c if c.isprintable() else "?" for c in line))
    print(f"optical depth along {axis}:\n")
    print("\n".join(contents.drawn(depths, pixel, min(72, console_of(width=80).width), 24)))
    print("\nin the matrix of a config:\n", *facts["config"], sep="\n")
    asked = {"--sigma-t": options.sigma_t, "--grid": options.grid, "--raw": options.raw}
    given = [str(part) for one in asked.items() if one[1] is not None for part in one]
    command = shlex.join(["freepath", "recommend", str(options.volume), *given])
    print(f"\nwhat is the fastest in it: {command}")
    if path:
        print(f"wrote {path}")
    return 0
