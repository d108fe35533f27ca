"""Writes a report in the format that a file's name, or --format, asks for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from freepath.errors import FreepathError, imported
from freepath.show.report.data import Report, load

SUFFIXES = {name: name for name in ("html", "md", "svg", "png", "pdf")}
SUFFIXES |= {"tex": "latex", "bib": "bibtex"}
"""Formats by the ends of names of files."""
FORMATS = tuple(SUFFIXES.values())
TEXTS = ("md", "latex", "bibtex")
"""What is printed where no file is named."""
STANDARD_OUTPUT = Path("-")


@dataclass(frozen=True)
class Choice:
    """What of results is shown, and how a picture is drawn."""

    chart: str = "cost"
    baseline: str = ""
    only: str = ""
    """A regular expression that names of cases match."""
    question: str = ""
    """One that questions match."""
    width_pt: float | None = None
    """Of a picture, in points of 1/72 inch; None for panels as wide as on the page."""
    titled: bool = True


USUAL = Choice()


def format_of(output: Path | None, wanted: str | None) -> str:
    """The format: as asked for, else as the file is named, else a page."""
    if output == STANDARD_OUTPUT:
        return wanted or "md"
    suffix = output.suffix.lower()[1:] if output else ""
    named = SUFFIXES.get(suffix)
    if wanted is None and output and named is None:
        expected = ", ".join(f".{name}" for name in SUFFIXES)
        raise FreepathError(f"{output}: expected a name that ends in one of {expected}")
    if wanted and named and named != wanted:
        raise FreepathError(f"--format {wanted} does not fit {output}")
    return wanted or named or "html"


def write(
    results: Sequence[Path], output: Path | None, wanted: str | None, choice: Choice = USUAL
) -> tuple[Report, Path]:
    """Write the report of results, into `output` or a file of the first one's folder.

    Raises FreepathError where a result cannot be read, a file not be written, a package is missing,
    or a chart has nothing to show.
    """
    report, data, chosen = made(results, output, wanted, choice)
    own, output = output is None, output or results[0] / f"report.{chosen}"
    try:
        if own and output.is_symlink():
            output.unlink()  # a folder may be from somebody else: what it points to is not ours
        output.write_bytes(data)
    except OSError as error:
        raise FreepathError(f"cannot write {output}: {error.strerror}") from error
    return report, output


def made(
    results: Sequence[Path], output: Path | None, wanted: str | None, choice: Choice = USUAL
) -> tuple[Report, bytes, str]:
    """The report of results, what a file of it holds, and its format; raises as `write` does."""
    chosen = format_of(output, wanted)
    report = load(results, choice.only, choice.question)
    if not report.measured:
        raise FreepathError("the result has no case that was measured, so there is no report of it")
    if chosen not in TEXTS:
        for module in ("altair", "vl_convert"):
            imported(module, f"a report as {chosen}")
        if chosen != "html":
            from freepath.show.report.pictures import drawn

            return report, drawn(report, choice, chosen), chosen
    return report, _maker(chosen)(report, choice.baseline).encode(), chosen


def _maker(chosen: str) -> Callable[[Report, str], str]:
    if chosen == "html":
        from freepath.show.report.page import page

        return page
    if chosen == "bibtex":
        from freepath.show.citations import bibtex

        return bibtex
    from freepath.show.report import text

    return text.latex if chosen == "latex" else text.markdown
