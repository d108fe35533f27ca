"""Texts and tables of Markdown that show what is in them as it is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from freepath.errors import printable


def text_of(text: str) -> str:
    """A text that Markdown shows as it is, in a line."""
    text = printable(text)
    special = {c: f"\\{c}" for c in "\\`*_[]<>|#"} | {"\n": " ", "\r": " "}
    return text.translate(str.maketrans(special))


def table_of(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """The lines of a table of Markdown."""
    lines = (" | ".join(map(text_of, row)) for row in (header, *rows))
    first, *others = (f"| {line} |" for line in lines)
    return [first, "|" + " --- |" * len(header), *others]
