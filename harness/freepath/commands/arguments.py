"""Arguments that several commands share."""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path
from typing import Any

import shtab


def add_config(command: Any) -> None:
    """Arguments that choose cases of a config."""
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
    add_trackers(command)


def add_device(command: Any, what: str) -> None:
    """-d, one device or several."""
    command.add_argument(
        "-d",
        "--device",
        action="append",
        default=[],
        metavar="DEVICE",
        help=f"{what} (default: $FREEPATH_DEVICE, or the first that works: `freepath devices`)",
    )


def add_output(command: Any, what: str, name: str, into: str = "output") -> None:
    """-o, the folder."""
    told = f"folder for {what} (default: results/{name}-TIME)"
    named = {"type": Path, "metavar": "DIR", "help": told, "dest": into}
    action = command.add_argument("-o", "--output", **named)
    action.complete = shtab.DIRECTORY


def add_timeout(command: Any) -> None:
    """--timeout, of builds and launches."""
    command.add_argument(
        "--timeout",
        type=positive,
        metavar="SECONDS",
        help="give a case up whose build, or one of whose launches, takes longer, twice (default: "
        "60 s and 20 times its at_most, on Oclgrind ten times that)",
    )


def add_volume(command: Any) -> None:
    """The file of a volume, and what of it."""
    told = "a file in one of the formats that docs/files.md lists, such as .vdb or .npy"
    command.add_argument("volume", type=Path, metavar="VOLUME", help=told).complete = shtab.FILE
    command.add_argument("--grid", metavar="NAME", help="which grid of an OpenVDB or NanoVDB file")
    told = "of raw numbers: voxels along x, y, z, type and byte order, as '8x9x10 uint16 big'"
    command.add_argument("--raw", type=_raw, metavar="WHAT", help=told)


def _raw(text: str) -> str:
    from freepath.config.models import RAW, RAW_EXPECTED

    if not re.fullmatch(RAW, text):
        raise argparse.ArgumentTypeError(f"expected {RAW_EXPECTED}, got '{text}'")
    return text


def add_sigma_t(command: Any) -> None:
    """--sigma-t; None where it is not given, which stands for 1."""
    told = "extinction where the volume's density is 1 (default: 1)"
    command.add_argument("--sigma-t", type=positive, metavar="X", help=told)


def add_trackers(command: Any) -> None:
    """--trackers, folders with further ones."""
    command.add_argument(
        "--trackers",
        action="append",
        default=[],
        type=Path,
        metavar="DIR",
        help="a folder with further trackers, one .cl file each; may be repeated",
    ).complete = shtab.DIRECTORY


def add_baseline(command: Any) -> None:
    """--baseline, what ratios are of."""
    command.add_argument(
        "--baseline",
        type=expression,
        default="",
        metavar="RE",
        help="the case that ratios are of, by its name (default: delta tracking with one majorant "
        "at tightness 1, where it is there; else the slowest that is known)",
    )


def expression(text: str) -> str:
    """A regular expression, as the type of an argument."""
    try:
        re.compile(text)
    except (re.error, RecursionError, OverflowError) as error:
        raise argparse.ArgumentTypeError(f"expected a regular expression: {error}") from error
    return text


def number_or_percent(text: str) -> float:
    """A number, or a share written as `5%` or `5 %`; NaN where it is none."""
    plain = text.strip().removesuffix("%")
    try:
        return float(plain) / (100.0 if plain != text.strip() else 1.0)
    except ValueError:
        return math.nan


def positive(text: str) -> float:
    """A finite number above 0, as the type of an argument."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1e30:
        raise argparse.ArgumentTypeError(f"expected a number above 0, got '{text}'")
    return value


def shard(text: str) -> tuple[int, int]:
    """I/N, the I-th of N parts, as the type of an argument."""
    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        expected = "expected I/N with I from 1 to N, such as 2/8"
        raise argparse.ArgumentTypeError(f"{expected}, got '{text}'")
    return int(number), int(count)
