"""What several commands do: find the cases of a config, print records and tables."""

from __future__ import annotations

import json
import os
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from freepath.errors import printable

if TYPE_CHECKING:
    from rich.console import Console

    from freepath.cases.plan import Case
    from freepath.compose.catalog import Catalog
    from freepath.config import Config


def cases_of(options: Namespace) -> tuple[Config, Catalog, list[Case]]:
    """The config, the trackers and the cases that the filters leave."""
    from freepath import config
    from freepath.cases import plan
    from freepath.compose import catalog

    known = catalog.load(options.trackers)
    path = config.find(options.config)
    loaded = config.load(path, known.parameter_models(), options.axis)
    cases = plan.select(plan.expand(loaded, known), options.include, options.exclude)
    return loaded, known, cases


def print_records(records: list[dict[str, Any]], *, as_json: bool) -> int:
    """As a table, or as JSON; returns the exit code."""
    from freepath.show import listing

    if as_json:
        print(json.dumps(records, indent=1))
    else:
        console_of().print(listing.table_of(records))
    return 0


def console_of(*, stderr: bool = False, width: int = 160) -> Console:
    """A console; one that is no terminal is so wide."""
    from rich.console import Console

    class Plain(Console):
        def render_str(self, text: str, **given: Any) -> Any:
            return super().render_str(printable(text), **given)

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # which main knows; rich would exit with 1

    # compilers' output is led away from descriptor 2, and the progress is not
    apart = stderr and sys.stderr.isatty()
    given = {"file": os.fdopen(os.dup(2), "w")} if apart else {"stderr": stderr}
    console = Plain(**given)
    return console if console.is_terminal else Plain(**given, width=width)


def let_go_of_output() -> None:
    """Go on where nobody reads what is printed, and keep Python from complaining at its end."""
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def unread() -> Iterator[None]:
    """Let the work go on whose reader has seen enough: its exit code must not say 0 too early."""
    try:
        yield
    except BrokenPipeError:
        let_go_of_output()


def print_tables(console: Console, rows: list[dict[str, str]], load: float, baseline: str) -> None:
    """The tables, and what each of them answers."""
    from freepath.device import environment
    from freepath.show import answers, table

    told = []
    for device, members in table.by_device(rows).items():
        console.print(f"{device}\n{environment.processor()}, load {load:.2f}", markup=False)
        groups = table.groups(members)
        for group in groups:
            cases = [one for one in map(answers.case_of, group) if one]
            base = answers.baseline_of(cases, baseline)

            def ratio(row: dict[str, str], base: Any = base) -> str:
                one = answers.case_of(row)
                known = one and base and one.settled
                return answers.digits(answers.ratio(base, one)[0]) if known else ""

            console.print("", table.table_of(group, ratio, console.width))
            failed = len(table.failures(group))
            line = answers.sentence(cases, 0.01, baseline, failed)
            told.append(f"{group[0]['medium']}: {line}" if len(groups) > 1 else line)
    for reason, count in table.skipped(rows).items():
        noun = "case" if count == 1 else "cases"
        console.print(f"skipped {count} {noun}: {reason}", highlight=False, markup=False)
    console.print(f"\n{table.LEGEND}\n", highlight=False)
    for line in told:
        console.print(line, highlight=False, markup=False)
    console.print()
