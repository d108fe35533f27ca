"""freepath from Python: run a config, load a result; both give a table."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from freepath.errors import RunError
from freepath.results import SUMMARY, ResultFolder, read_rows, records


def run(
    config: str | Path,
    output: str | Path | None = None,
    *,
    devices: Sequence[str] = (),
    axes: Sequence[str] = (),
    progress: Callable[[float, int, str], None] | bool = True,
) -> Any:
    """Run a config, a path or the name of one that ships, as `freepath run` does.

    `output` is the folder for the results (default: results/NAME-TIME), `devices` and `axes` are
    what -d and -a take. `progress` is told how many cases are done, of how many, and what is being
    done; True prints a line a case. Returns what `load` does. Raises FreepathError with the message
    that the command line prints, and KeyboardInterrupt with what was measured left in the folder.
    """
    from freepath import catalog, drivers, plan, selection, session
    from freepath import config as configs

    clock = session.Clock(time.perf_counter())
    known = catalog.load([])
    loaded = configs.load(configs.find(str(config)), known.parameter_models(), list(axes))
    cases = plan.select(plan.expand(loaded, known), None, None)
    parts = selection.checked(selection.resolve(list(devices)))
    folder = ResultFolder(Path(output) if output else session.new_folder(loaded.name))
    if not selection.can_be_here(parts):
        for part in parts:
            chosen = [word for info in part.infos for word in ("-d", selection.selector_of(info))]
            chosen += [word for axis in axes for word in ("-a", axis)]
            command = ["run", str(loaded.path), "-o", str(folder.folder), "--rows-only", *chosen]
            command += ["--resume"] * folder.holds_rows
            ended = drivers.in_process_of(part.driver, command, capture=progress is not True)
            if part.failure or ended.returncode:
                why = part.failure or drivers.how_it_ended(part.driver, ended.returncode)
                raise RunError(f"{why}\n{ended.stderr or ''}".strip())
        return load(folder.folder)
    opened = selection.opened(parts)
    on_done = _say if progress is True else _ignore
    on_progress = progress if callable(progress) else _ignore
    session.Run(loaded, known, cases, folder, clock, on_done, on_progress).execute(opened)
    return load(folder.folder)


def _say(row: dict[str, Any]) -> None:
    print(f"{row['status']:>8}  {row['case']}")


def _ignore(*_: Any) -> None:
    pass


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
