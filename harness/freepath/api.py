"""freepath from Python: run a config, load a result; both give a table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freepath.errors import RunError
from freepath.results.folder import SUMMARY, ResultFolder, read_rows, records

if TYPE_CHECKING:
    from freepath.cases.plan import Case
    from freepath.compose.catalog import Catalog
    from freepath.config import Config
    from freepath.device.opencl import Device
    from freepath.device.selection import Part
    from freepath.measure.sweep import Listener, Sweep


def sweep(  # noqa: PLR0913 (what a sweep is made of; most has a default)
    config: str | Path | Config,
    output: str | Path | None = None,
    *,
    devices: Sequence[Device] = (),
    axes: Sequence[str] = (),
    known: Catalog | None = None,
    cases: list[Case] | None = None,
    resume: bool = False,
    confirm: bool = False,
    **more: Any,
) -> Sweep:
    """Make a sweep, whose `run()` measures it.

    `config` is a path, the name of a config that ships, or one that is loaded; `output` the folder
    for the results (default: results/NAME-TIME, with `resume` the newest of these). `devices` are
    open, for a sweep in this process; `measure.worker.run` opens its own in another one, which is
    watched. `axes` are what -a takes. `known` are the trackers (default: the
    shipped ones), `cases` those of the config that are wanted (default: all). A `listener` and a
    `clock` may be given. Raises FreepathError with the message that the command line prints.
    """
    from freepath import config as configs
    from freepath.cases import plan
    from freepath.compose import catalog
    from freepath.measure.sweep import Sweep
    from freepath.results import folder as results

    known = known or catalog.load()
    if isinstance(config, (str, Path)):
        config = configs.load(configs.find(str(config)), known.parameter_models(), list(axes))
    cases = cases or plan.expand(config, known)
    path = output or (results.newest_folder if resume else results.new_folder)(config.name)
    folder = ResultFolder(Path(path), resume=resume, confirm=confirm)
    return Sweep(config, known, cases, list(devices), folder, confirm=confirm, **more)


def run(
    config: str | Path,
    output: str | Path | None = None,
    *,
    devices: Sequence[str] = (),
    axes: Sequence[str] = (),
    progress: Callable[[float, int, str], None] | bool = True,
    timeout_s: float | None = None,
) -> Any:
    """Run a config, a path or the name of one that ships, as `freepath run` does.

    `output` is the folder for the results (default: results/NAME-TIME), `devices` and `axes` are
    what -d and -a take, `timeout_s` what --timeout takes. `progress` is called with how many cases
    are done, of how many, and what is being done; True prints a line per case. Returns what `load`
    does. Raises FreepathError with the message that the command line prints, and KeyboardInterrupt
    with what was measured left in the folder.
    """
    from freepath.device import selection
    from freepath.measure import worker
    from freepath.measure.sweep import Listener

    listener = Listener()
    if progress is True:
        listener.row = _say
    elif callable(progress):
        listener.progress = progress
    parts = selection.checked(selection.resolve(list(devices)))
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


def _say(row: dict[str, Any]) -> None:
    print(f"{row['status']:>8}  {row['case']}")


def load(result: str | Path) -> Any:
    """A row a case of a result: a pandas.DataFrame, or a list of records where pandas is missing.

    Numbers are floats or integers (infinite where a bias stands in the way), unknown cells None or
    NaN. Raises FreepathError where the folder holds no result of this schema version.
    """
    from freepath.errors import FreepathError

    summary = Path(result) / SUMMARY
    if not summary.is_file():
        raise FreepathError(f"{result}: expected the folder of a run, with {SUMMARY} in it")
    found = [
        {name: float("inf") if value == "inf" else value for name, value in row.items()}
        for row in records(read_rows(summary))
    ]
    try:
        import pandas
    except ImportError:
        return found
    return pandas.DataFrame(found)
