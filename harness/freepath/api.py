"""freepath from Python: run a config, load a result, compare two."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freepath.errors import RunError, expect
from freepath.results.folder import ResultFolder

if TYPE_CHECKING:
    from freepath.cases.plan import Case
    from freepath.compose.catalog import Catalog
    from freepath.config import Config
    from freepath.device.opencl import Device
    from freepath.device.selection import Part
    from freepath.measure.sweep import Listener, Sweep
    from freepath.show.compare import Comparison
    from freepath.show.result import Result

Given = str | os.PathLike[str] | Mapping[str, Any]
"""A config: a path, the name of one that ships, or a dictionary of what a file would hold."""


def sweep(  # noqa: PLR0913 (what a sweep is made of; most has a default)
    config: Given | Config,
    output: str | Path | None = None,
    *,
    devices: Sequence[Device] = (),
    axes: Iterable[str] | Mapping[str, Any] = (),
    known: Catalog | None = None,
    cases: list[Case] | None = None,
    resume: bool = False,
    confirm: bool = False,
    **more: Any,
) -> Sweep:
    """Make a sweep, whose `run()` measures it.

    `config` is a path, the name of a config that ships, a dictionary, or one that is loaded;
    `output` the folder for the results (default: results/NAME-TIME, with `resume` the newest of
    these). `devices` are open, for a sweep in this process; `measure.worker.run` opens its own in
    another one, which is watched. `axes` are what -a takes, or values by the names of axes. `known`
    are the trackers (default: the shipped ones), `cases` those of the config that are wanted
    (default: all). A `listener` and a `clock` may be given. Raises FreepathError with the message
    that the command line prints.
    """
    from freepath import config as configs
    from freepath.cases import plan
    from freepath.compose import catalog
    from freepath.measure.sweep import Sweep
    from freepath.results import folder as results

    known = known or catalog.load()
    if not isinstance(config, configs.Config):
        fits = isinstance(config, (str, os.PathLike, Mapping))
        expect("config", fits, "a path, the name of a config or a dictionary", config)
        given = config if isinstance(config, Mapping) else configs.find(os.fspath(config))
        if isinstance(axes, Mapping):
            axes = [f"{axis}={json.dumps(values)}" for axis, values in axes.items()]
        config = configs.load(given, known.parameter_models(), listed("axes", axes))
    cases = cases or plan.expand(config, known)
    path = output or (results.newest_folder if resume else results.new_folder)(config.name)
    folder = ResultFolder(Path(path), resume=resume, confirm=confirm)
    return Sweep(config, known, cases, list(devices), folder, confirm=confirm, **more)


def run(
    config: Given,
    output: str | Path | None = None,
    *,
    devices: str | Sequence[str] = (),
    axes: Iterable[str] | Mapping[str, Any] = (),
    progress: Callable[[float, int, str], None] | bool = True,
    timeout_s: float | None = None,
) -> Result:
    """Run a config, a path, a name of one that ships or a dictionary, as `freepath run` does.

    `output` is the folder for the results (default: results/NAME-TIME), `devices` are what -d
    takes, `axes` what -a takes, or values by the names of axes, `timeout_s` what --timeout takes.
    `progress` is called with how many cases are done, of how many, and what is being done; True
    prints a line per case. Returns what `load` does. Raises FreepathError with the message that the
    command line prints, and KeyboardInterrupt with what was measured left in the folder.
    """
    from freepath.device import selection
    from freepath.measure import worker
    from freepath.measure.sweep import Listener

    listener = Listener()
    if progress is True:
        listener.row = _say
    elif callable(progress):
        listener.progress = progress
    parts = selection.checked(selection.resolve(listed("devices", devices)))
    folder = output

    def make(resume: bool) -> Sweep:
        nonlocal folder
        made = sweep(config, folder, axes=axes, resume=resume)
        folder = made.folder.folder
        return made

    def measure(made: Sweep, part: Part) -> None:
        worker.run(made, part, timeout_s)

    done = list(each_driver(parts, make, measure, lambda part: nullcontext(listener)))
    for part, _ in done:
        if part.failure:
            raise RunError(f"{part.driver.name}: {part.failure}")
    return load(folder)


def each_driver(
    parts: Iterable[Part],
    make: Callable[[bool], Sweep],
    measure: Callable[[Sweep, Part], None],
    watched: Callable[[Part], AbstractContextManager[Listener]],
) -> Iterator[tuple[Part, Sweep | None]]:
    """Measure a sweep on one driver after the other, into one folder.

    `make` makes it, told whether the folder holds rows of an earlier driver; `watched` gives the
    listener for a part. Yields each part when it is done, with why it failed if it did, and its
    sweep; None for one that cannot be used.
    """
    sweep = None
    for part in parts:
        if part.failure:
            yield part, None
            continue
        sweep = make(sweep is not None and sweep.folder.holds_rows)
        try:
            with watched(part) as sweep.listener:
                measure(sweep, part)
        except RunError as error:
            part = part._replace(failure=str(error))  # noqa: PLW2901 (the same, with its end)
        yield part, sweep


def listed(name: str, given: str | Iterable[str]) -> list[str]:
    """Texts, of which there may be one alone."""
    found = [given] if isinstance(given, str) else given
    fits = isinstance(found, Iterable) and all(isinstance(one, str) for one in found)
    expect(name, fits, "a text or a list of texts", given)
    return list(found)


def _say(row: dict[str, Any]) -> None:
    print(f"{row['status']:>8}  {row['case']}")


def load(result: str | os.PathLike[str]) -> Result:
    """A result: its cases as a table, which of them is the fastest, its charts.

    Raises FreepathError where the folder holds no result of this schema version.
    """
    from freepath.show.result import Result

    expect("result", isinstance(result, (str, os.PathLike)), "the folder of a run", result)
    found = Result(Path(result))
    found.rows  # noqa: B018 (which refuses what is none)
    return found


def compare(
    reference: Any, contender: Any, *, other_machine: bool = False, **settings: Any
) -> Comparison:
    """Compare two results, or folders of several runs, as `freepath compare` does.

    `settings` are alpha, factor, drift and times (docs/compare.md). Raises FreepathError where they
    should not be compared: `other_machine` compares those of different machines nevertheless.
    """
    from freepath.show import compare as comparing

    names = comparing.Settings.__dataclass_fields__
    for name in settings:
        expect("compare", name in names, f"arguments of {', '.join(names)}", name)
    sides = []
    for name, one in (("reference", reference), ("contender", contender)):
        expect(name, not getattr(one, "including", ""), "a whole result, not of `only`", one)
        folder = getattr(one, "folder", one)
        expect(name, isinstance(folder, (str, os.PathLike)), "a result or its folder", one)
        sides.append(comparing.load(Path(folder)))
    return comparing.comparison(*sides, comparing.Settings(**settings), other_machine)
