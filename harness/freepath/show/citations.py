"""What the trackers of a result are from, as BibTeX: the citations of their front matter.

A citation is `Family, Family YEAR, Title (remark)`, several are parted by semicolons; what has no
year is a remark.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from freepath.compose import catalog
from freepath.show.report.data import Report

REFERENCE = re.compile(
    r"(?P<authors>.+?) (?P<year>\d{4})(?:, (?P<title>[^(]+?))?(?: \((?P<note>.*)\))?"
)


class Reference(NamedTuple):
    """A work; title and note may be empty."""

    authors: tuple[str, ...]
    year: str
    title: str
    note: str

    @property
    def key(self) -> str:
        """Its first author and the year, with the first long word of the title."""
        word = next(iter(re.findall(r"[a-z]{5,}", self.title.lower())), "")
        return re.sub(r"[^a-z0-9]", "", self.authors[0].lower()) + self.year + word


def references(citation: str) -> list[Reference]:
    """The works that a citation names."""
    found = []
    for part in (one.strip() for one in citation.split(";")):
        if match := REFERENCE.fullmatch(part):
            names = re.sub(r" et al\.$", ", others", match["authors"]).split(", ")
            parts = match["year"], match["title"] or "", match["note"] or ""
            found.append(Reference(tuple(names), *parts))
    return found


def bibtex(report: Report, baseline: str = "") -> str:
    """An entry for each work that the trackers of a report are from, with which these are."""
    known = catalog.load().trackers
    entries: dict[str, tuple[Reference, list[str]]] = {}
    lines = []
    for name in dict.fromkeys(row["tracker"] for row in report.rows):
        works = references(known[name].citation) if name in known else []
        if not works:
            why = known[name].citation if name in known else "is no shipped tracker"
            lines.append(f"% {_told(name)}: {_told(why)}")
        for one in works:
            remark = f" ({one.note})" if one.note else ""
            entries.setdefault(one.key, (one, []))[1].append(f"{name}{remark}")
    for key, (one, names) in entries.items():
        authors = " and ".join(f"{{{name}}}" if " " in name else name for name in one.authors)
        fields = {"author": authors, "title": f"{{{one.title}}}", "year": one.year}
        told = [f"  {field} = {{{text}}}" for field, text in fields.items() if text.strip("{}")]
        lines += [f"% {', '.join(names)}", f"@misc{{{key},", ",\n".join(told), "}"]
    return "\n".join(lines) + "\n"


def _told(text: str) -> str:
    return " ".join(text.split())
