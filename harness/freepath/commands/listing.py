"""`freepath list`: what a config may name."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from freepath.commands.arguments import add_trackers
from freepath.commands.common import print_records

LISTS = ("trackers", "media", "majorants", "effects", "configs")


def add(commands: Any) -> None:
    """Declare its arguments."""
    command = commands.add_parser(
        "list",
        help="list trackers, media, majorants, effects or configs",
        description="List what a config may name, and the configs that come with freepath.",
        allow_abbrev=False,
    )
    command.add_argument(
        "what", nargs="?", choices=LISTS, default=LISTS[0], help="trackers if none"
    )
    command.add_argument("--short", action="store_true", help="a line each")
    command.add_argument("--json", action="store_true", help="as JSON")
    add_trackers(command)


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.compose import catalog
    from freepath.show import listing

    records = listing.records_of(options.what, catalog.load(options.trackers))
    if options.short:
        records = [dict(list(record.items())[:2]) for record in records]
    return print_records(records, as_json=options.json)
