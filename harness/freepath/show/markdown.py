"""Texts and tables of Markdown and HTML that show what is in them as it is."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterable, Sequence

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


def html_table(
    header: Sequence[str], rows: Iterable[Sequence[str]], style: Callable[[str], str] = "".format
) -> str:
    """A table of HTML; `style` gives the attributes of a cell, by its text."""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in header)
    lines = ([f"<td{style(text)}>{html.escape(text)}</td>" for text in row] for row in rows)
    body = "".join(f"<tr>{''.join(line)}</tr>" for line in lines)
    return f"<div><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
