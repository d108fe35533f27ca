"""`freepath explain`: what a word of tables and docs means."""

from __future__ import annotations

from argparse import Namespace
from typing import Any


def add(commands: Any) -> None:
    """Declare its arguments."""
    command = commands.add_parser(
        "explain",
        help="explain a word of tables and docs",
        description="Explain a word of tables and docs; without one, list the words.",
        allow_abbrev=False,
    )
    command.add_argument("word", nargs="*", metavar="WORD", help="such as: tentative collision")


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.show import glossary

    print(glossary.explain(" ".join(options.word)) if options.word else "\n".join(glossary.WORDS))
    return 0
