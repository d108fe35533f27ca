"""What several commands do: find the cases of a config, print records and tables."""

from __future__ import annotations

import json
import os
import shutil
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freepath.errors import printable

if TYPE_CHECKING:
    from rich.console import Console

    from freepath.cases.plan import Case
    from freepath.compose.catalog import Catalog
    from freepath.config import Config
    from freepath.scene.volumes.reading import Volume

Keys = dict[str, Any]
"""Of a volume, in a config."""


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


def volume_of(file: Path, sigma_t: float | None, **how: str | None) -> tuple[Volume, Keys]:
    """A volume of the command line, and the keys by which a config names it.

    It is found where `run` finds those of a config; `how` are its `grid` and `raw`. Raises
    VolumeError where it is none.
    """
    from freepath.errors import VolumeError
    from freepath.scene.volumes.files import find_file
    from freepath.scene.volumes.reading import read_volume

    file = find_file(file.absolute() if os.path.lexists(file) else file)
    if not str(file).isprintable():
        raise VolumeError(f"{ascii(str(file))}: expected a name of characters that can be printed")
    volume = read_volume(file, **how)
    if not volume.densities.any():
        raise VolumeError(f"{file}: is empty: expected a density above 0 in a voxel at least")
    named = {name: value for name, value in how.items() if value is not None}
    return volume, {"file": str(file.resolve()), "sigma_t": sigma_t or 1.0, **named}


MARK = ".freepath-made"


def own_folder(folder: Path, command: str) -> None:
    """Make a folder, or empty one that the same command made; raises UsageError for any other."""
    from freepath.errors import UsageError
    from freepath.results.folder import write

    mark = folder / MARK
    try:
        held = sorted(folder.iterdir()) if folder.exists() else []
        if held and not (mark.is_file() and mark.read_text("utf-8") == command):
            what = f"or made by `freepath {command}`"
            raise UsageError(f"{folder}: expected a folder that is empty, not there yet, {what}")
        for one in held:
            shutil.rmtree(one) if one.is_dir() and not one.is_symlink() else one.unlink()
        folder.mkdir(parents=True, exist_ok=True)
        write(mark, command)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be a folder for results: {error.strerror}") from error


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
