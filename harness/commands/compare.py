"""`freepath compare`: what became faster, slower, noisier or different."""

from __future__ import annotations

from argparse import ArgumentTypeError, Namespace
from pathlib import Path
from typing import Any

import shtab

REGRESSION = 1


def add(commands: Any) -> None:
    """Declare its arguments."""
    compare = commands.add_parser(
        "compare",
        help="compare results with a reference",
        description="Compare results case by case: times by repeated rounds, variances, estimates "
        "by z, lookups exactly. Ratios are contender / reference. REFERENCE and CONTENDER are "
        "folders of a run, or folders that hold several runs of the same sweep, which tells far "
        "more about times.",
        epilog="exit codes: 0 no regression; 1 a regression; 2 usage, or results that should not "
        "be compared",
        allow_abbrev=False,
    )
    compare.add_argument(
        "reference", type=Path, metavar="REFERENCE", help="what to compare with"
    ).complete = shtab.DIRECTORY
    compare.add_argument(
        "contender", type=Path, nargs="+", metavar="CONTENDER", help="what to judge; may be several"
    ).complete = shtab.DIRECTORY
    compare.add_argument(
        "--alpha",
        type=_share,
        default=0.05,
        metavar="A",
        help="expected share of false findings among the findings (default: 0.05)",
    )
    compare.add_argument(
        "--factor",
        type=_ratio,
        default=1.01,
        metavar="F",
        help="ratio of times or variances that is too small to matter (default: 1.01)",
    )
    compare.add_argument(
        "--drift",
        type=_ratio,
        metavar="F",
        help="ratio by which all times of a scene may differ between runs of the machine without "
        "a reason, to be taken out of each case (default: all of it, unless several runs on either "
        "side show that it is no drift)",
    )
    compare.add_argument("--no-times", action="store_true", help="do not compare times")
    compare.add_argument("--all", action="store_true", help="print the cases that did not change")
    compare.add_argument(
        "--other-machine",
        action="store_true",
        help="compare results of different machines nevertheless",
    )
    compare.add_argument("--format", choices=("text", "csv", "html"), help="what to write")
    compare.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="a .csv or .html file to write"
    ).complete = shtab.FILE


def _share(text: str) -> float:
    value = float(text)
    if not 0 < value < 1:
        raise ArgumentTypeError(f"expected a number between 0 and 1, got {text}")
    return value


def _ratio(text: str) -> float:
    value = float(text)
    if not 1 <= value < 1e6:
        raise ArgumentTypeError(f"expected a ratio of 1 or more, got {text}")
    return value


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath import compare
    from freepath.errors import FreepathError

    wanted = _format(options)
    reference = compare.load(options.reference)
    sides = [compare.load(path) for path in options.contender]
    for side in sides:
        reason = "" if options.other_machine else compare.refuse(reference, side)
        if reason:
            raise FreepathError(
                f"{reference.name} and {side.name}: {reason}; --other-machine compares them anyway"
            )
    settings = compare.Settings(
        options.alpha, options.factor, options.drift, times=not options.no_times
    )
    found = [compare.compare(reference, side, settings) for side in sides]
    _write(options, wanted, reference, sides, found)
    return REGRESSION if any(one.regressed for judged, _ in found for one in judged) else 0


def _format(options: Namespace) -> str:
    from freepath.errors import FreepathError

    suffix = options.output.suffix.lower()[1:] if options.output else "text"
    wanted = options.format or suffix
    if wanted not in ("text", "csv", "html") or (options.output and wanted == "text"):
        raise FreepathError(f"{options.output}: expected a name that ends in .csv or .html")
    return wanted


def _write(options: Namespace, wanted: str, reference: Any, sides: list, found: list) -> None:
    from freepath.compare import showing
    from freepath.errors import FreepathError

    names, results = [side.name for side in sides], [judged for judged, _ in found]
    if wanted == "text":
        return _print(options, names, found)
    if wanted == "csv":
        text = showing.as_csv(names, results)
    else:
        text = showing.as_html(reference.name, names, results)
    if not options.output:
        return print(text, end="")
    try:
        options.output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FreepathError(f"cannot write {options.output}: {error.strerror}") from error
    return _print(options, names, found)


def _print(options: Namespace, names: list[str], found: list) -> None:
    from freepath.commands.common import console_of
    from freepath.compare import showing

    console = console_of()
    if len(names) > 1:
        console.print(showing.matrix_table(names, [judged for judged, _ in found]))
    for name, (judged, shifts) in zip(names, found, strict=True):
        if len(names) == 1 and (options.all or any(one.verdict != "SAME" for one in judged)):
            console.print(showing.table(judged, everything=options.all))
        for line in showing.shift_lines(shifts):
            console.print(line, highlight=False, markup=False)
        console.print(f"{name}: {showing.totals(judged)}", highlight=False, markup=False)
    if options.output:
        console.print(f"wrote {options.output}", highlight=False, markup=False, soft_wrap=True)
