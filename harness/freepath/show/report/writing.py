"""Writes a report in the format that a file's name, or --format, asks for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from freepath.errors import FreepathError, imported
from freepath.show.report.data import Report, load

FORMATS = ("html", "md", "svg", "png")


STANDARD_OUTPUT = Path("-")


def format_of(output: Path | None, wanted: str | None) -> str:
    """The format: as asked for, else as the file is named, else a page."""
    if output == STANDARD_OUTPUT:
        return wanted or "md"
    suffix = output.suffix.lower()[1:] if output else ""
    if wanted is None and output and suffix not in FORMATS:
        expected = ", ".join(f".{name}" for name in FORMATS)
        raise FreepathError(f"{output}: expected a name that ends in one of {expected}")
    if wanted and suffix in FORMATS and suffix != wanted:
        raise FreepathError(f"--format {wanted} does not fit {output}")
    return wanted or suffix or "html"


def write(
    results: Sequence[Path],
    output: Path | None,
    wanted: str | None,
    chart: str = "cost",
    baseline: str = "",
) -> tuple[Report, Path]:
    """Write the report of results, into `output` or a file of the first one's folder.

    Raises FreepathError where a result cannot be read, a file not be written, a package is missing,
    or a chart has nothing to show.
    """
    report, data, chosen = made(results, output, wanted, chart, baseline)
    own, output = output is None, output or results[0] / f"report.{chosen}"
    try:
        if own and output.is_symlink():
            output.unlink()  # a folder may be from somebody else: what it points to is not ours
        output.write_bytes(data)
    except OSError as error:
        raise FreepathError(f"cannot write {output}: {error.strerror}") from error
    return report, output


def made(
    results: Sequence[Path],
    output: Path | None,
    wanted: str | None,
    chart: str = "cost",
    baseline: str = "",
) -> tuple[Report, bytes, str]:
    """The report of results, what a file of it holds, and its format; raises as `write` does."""
    chosen = format_of(output, wanted)
    report = load(results)
    if not report.measured:
        raise FreepathError("the result has no case that was measured, so there is no report of it")
    if chosen != "md":
        for module in ("altair", "vl_convert"):
            imported(module, f"a report as {chosen}")
    if chosen == "html":
        from freepath.show.report.page import page

        return report, page(report, baseline).encode(), chosen
    if chosen == "md":
        from freepath.show.report.text import markdown

        return report, markdown(report, baseline).encode(), chosen
    from freepath.show.report.pictures import drawn

    return report, drawn(report, chart, chosen), chosen
