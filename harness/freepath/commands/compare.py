"""`freepath compare`: what became faster, slower, noisier or different."""

from __future__ import annotations

from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shtab

from freepath.commands.arguments import number_or_percent

if TYPE_CHECKING:
    from freepath.show.compare import Comparison, Side

REGRESSION = 1
FORMATS = ("text", "csv", "html", "json", "md")


def add(commands: Any) -> None:
    """Declare its arguments."""
    compare = commands.add_parser(
        "compare",
        help="compare results with a reference",
        description="Compare results case by case: times by repeated rounds, variances, estimates "
        "by z, lookups exactly. Ratios are contender / reference. REFERENCE and CONTENDER are "
        "folders of a run, or folders that hold several runs of the same sweep, which shows "
        "far more about times.",
        epilog="exit codes: 0 no verdict of --fail-on; 1 one of them; 2 usage, or results that "
        "should not be compared",
        allow_abbrev=False,
    )
    compare.add_argument(
        "reference", type=Path, metavar="REFERENCE", help="what to compare with"
    ).complete = shtab.DIRECTORY
    compare.add_argument(
        "contender", type=Path, nargs="+", metavar="CONTENDER", help="what to judge; may be several"
    ).complete = shtab.DIRECTORY
    compare.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="a .csv, .html, .json or .md to write"
    ).complete = shtab.FILE
    add_judging(compare)


def add_judging(command: Any) -> None:
    """What is said of two sides, and how."""
    command.add_argument(
        "--alpha",
        type=_share,
        default=0.05,
        metavar="A",
        help="expected share of false findings among the findings (default: 0.05)",
    )
    command.add_argument(
        "--factor",
        type=_ratio,
        default=1.01,
        metavar="F",
        help="ratio of times, variances or estimates that is too small to matter, as 1.05 or 5%% "
        "(default: 1.01)",
    )
    command.add_argument(
        "--drift",
        type=_ratio,
        metavar="F",
        help="ratio by which all times of a scene may differ between runs of the machine without "
        "a reason, to be taken out of each case (default: all of it, unless several runs on either "
        "side show that it is no drift)",
    )
    command.add_argument("--no-times", action="store_true", help="do not compare times")
    command.add_argument("--all", action="store_true", help="print the cases that did not change")
    command.add_argument(
        "--other-machine",
        action="store_true",
        help="compare results of different machines nevertheless",
    )
    command.add_argument(
        "--fail-on",
        type=_words,
        default=("SLOWER", "MORE_NOISE", "DIFFERENT", "MISSING"),
        metavar="WORDS",
        help="verdicts that make exit code 1, e.g. SLOWER,UNDECIDED, or none (default: "
        "SLOWER,MORE_NOISE,DIFFERENT,MISSING)",
    )
    command.add_argument("--format", choices=FORMATS, help="what to write")
    for name in ("json", "md"):
        command.add_argument(
            f"--{name}",
            action="store_const",
            dest="format",
            const=name,
            help=f"the same as --format {name}",
        )
    command.add_argument(
        "--output-junit", type=Path, metavar="FILE", help="write verdicts as JUnit XML"
    ).complete = shtab.FILE


def _share(text: str) -> float:
    value = number_or_percent(text)
    if not 0 < value < 1:
        raise ArgumentTypeError(f"expected a share between 0 and 1, as 0.05 or 5%, got '{text}'")
    return value


def _ratio(text: str) -> float:
    value = number_or_percent(text) + ("%" in text)
    if not 1 <= value < 1e6:
        raise ArgumentTypeError(
            f"expected a ratio of 1 or more, as 1.05, or what it is above 1, as 5%, got '{text}'"
        )
    return value


def _words(text: str) -> tuple[str, ...]:
    from freepath.show.compare import VERDICTS

    words = [word.strip().upper() for word in text.split(",") if word.strip()]
    for word in words:
        if word not in (*VERDICTS, "NONE"):
            known = ", ".join(VERDICTS)
            raise ArgumentTypeError(f"expected words of {known}, or none, got '{word}'")
    return tuple(words)


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.show import compare

    reference = compare.load(options.reference)
    return judge(options, reference, [compare.load(path) for path in options.contender])


def judge(
    options: Namespace, reference: Side, sides: Sequence[Side], *, same_samples: bool = True
) -> int:
    """Compare sides with a reference and show that; returns the exit code."""
    from freepath.show import compare

    wanted = _format(options)
    settings = compare.Settings(
        options.alpha, options.factor, options.drift, not options.no_times, same_samples
    )
    found = [compare.comparison(reference, s, settings, options.other_machine) for s in sides]
    _write(options, wanted, found)
    words = {word for one in found for word in one.verdicts}
    return REGRESSION if words & set(options.fail_on) else 0


def _format(options: Namespace) -> str:
    from freepath.errors import FreepathError

    suffix = options.output.suffix.lower()[1:] if options.output else "text"
    wanted = options.format or suffix
    if wanted not in FORMATS or (options.output and wanted == "text"):
        raise FreepathError(
            f"{options.output}: expected a name that ends in .csv, .html, .json or .md"
        )
    return wanted


def _write(options: Namespace, wanted: str, found: Sequence[Comparison]) -> None:
    from freepath.errors import FreepathError
    from freepath.show.compare import showing

    reference, to_show = found[0].reference.name, found[0].settings.to_show
    names, results = [one.contender.name for one in found], [one.judged for one in found]
    made = {
        "csv": lambda: showing.as_csv(names, results),
        "html": lambda: showing.as_html(reference, names, results),
        "json": lambda: showing.as_json(names, results),
        "md": lambda: showing.as_markdown(reference, names, results, to_show),
    }
    path = options.output_junit
    try:
        if path:
            showing.write_junit(path, names, results, options.fail_on)
        path = options.output
        if path:
            path.write_text(made[wanted](), encoding="utf-8")
    except OSError as error:
        raise FreepathError(f"cannot write {path}: {error.strerror}") from error
    if wanted != "text" and not options.output:
        print(made[wanted](), end="")
        return
    if len(found) > 1:
        from freepath.commands.common import console_of

        console_of().print(showing.matrix_table(names, results))
    for one in found:
        print("\n".join(one.lines(everything=options.all, cases=len(found) == 1)))
    if options.output:
        print(f"wrote {options.output}")
