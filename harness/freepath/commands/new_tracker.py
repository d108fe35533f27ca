"""`freepath new-tracker`: the file to begin a tracker with, a copy of one that is there."""

from __future__ import annotations

import re
from argparse import Namespace
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Declare its arguments."""
    new = commands.add_parser(
        "new-tracker",
        help="write the file to begin a new tracker with",
        description="Write NAME.cl into the current folder: a copy of a shipped tracker with a "
        "name of its own, to be changed and given to `freepath try`.",
        allow_abbrev=False,
    )
    new.add_argument("name", metavar="NAME", help="of the new tracker: letters, digits and _")
    new.add_argument("--like", required=True, metavar="TRACKER", help="the shipped one to copy")


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.compose import catalog
    from freepath.errors import UsageError

    known, file = catalog.load().trackers, Path(f"{options.name}.cl")
    if options.like not in known:
        raise UsageError(f"--like {options.like}: expected one of {', '.join(known)}")
    if not catalog.is_identifier(options.name) or options.name in known:
        what = "expected a new name of letters, digits and _, a letter first"
        raise UsageError(f"{what}, got '{options.name}'")
    parent = known[options.like]
    head = f"title: {options.name}, made from {parent.title}\nlike: {parent.name}\n"
    text = re.sub(r"^like:.*\n", "", parent.source, count=1, flags=re.MULTILINE)
    text = re.sub(r"^title:.*\n", lambda _: head, text, count=1, flags=re.MULTILINE)
    try:
        with file.open("x", encoding="utf-8") as new:
            new.write(text)
    except FileExistsError:
        raise UsageError(f"{file}: is there already") from None
    print(f"wrote {file}; change it, and: freepath try {file}")
    return 0
