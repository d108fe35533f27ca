"""Joins the folders of several runs of a config, such as the shards of a sweep, into one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from freepath.errors import FreepathError
from freepath.results import folder as results
from freepath.results import reading
from freepath.results.columns import COLUMNS, CONFIRM_COLUMNS, SAMPLE_COLUMNS
from freepath.results.folder import CONFIRM, PLACE, RUN, SAMPLES, SUMMARY, ResultFolder, Row

BESIDE = ("build-*.log", "pictures/*", "pictures/*/*")
"""What rows speak of beside the tables."""
LISTED = (("devices", "name"), ("cases", "case_id"))


def merge(found: Sequence[Path], output: Path) -> list[str]:
    """Write the rows of all results, and what belongs to them, into a new folder.

    Returns what should be known of them: shards that are missing, and sessions that did not end.
    Raises FreepathError, before anything is written, where two have a row of the same case on the
    same device, where they are of different configs, and where one cannot be read.
    """
    runs = _runs(found)
    rows, rounds, confirmed = [], [], []
    owners: dict[tuple[str, ...], str] = {}
    for one in found:
        cases, samples = results.read_result(one)
        rows += cases
        rounds += samples
        if (one / CONFIRM).exists():
            confirmed += results.read_rows(one / CONFIRM, CONFIRM_COLUMNS)
        _refuse_doubles(one / SUMMARY, cases, owners)
    folder = ResultFolder(output, confirm=bool(confirmed))
    files = dict(_beside(found))
    folder.open([])
    try:
        for path, source in files.items():
            (output / path).parent.mkdir(parents=True, exist_ok=True)
            with results.replacing(output / path, "wb") as file:
                file.write(source.read_bytes())
        folder.write_run(_joined(runs))
        folder.rewrite(SAMPLES, SAMPLE_COLUMNS, rounds)
        if confirmed:
            folder.rewrite(CONFIRM, CONFIRM_COLUMNS, confirmed)
        folder.rewrite(SUMMARY, COLUMNS, rows)
    except OSError as error:
        raise FreepathError(f"{error.filename or output}: {error.strerror}") from error
    finally:
        folder.close()
    return _told(found, runs)


def _runs(found: Sequence[Path]) -> list[dict[str, Any]]:
    """What run.json says of each; raises FreepathError where they are of different configs."""
    for one in found:
        if not (one / SUMMARY).is_file():
            raise FreepathError(f"{one}: expected the folder of a run, with {SUMMARY} in it")
    runs = [reading.facts(one / RUN) for one in found]
    for one, run in zip(found, runs, strict=True):
        if run.get("config_text") != runs[0].get("config_text"):
            raise FreepathError(f"{one}: is of another config than {found[0]}; `report` takes both")
    return runs


def _refuse_doubles(path: Path, rows: Sequence[Row], owners: dict[tuple[str, ...], str]) -> None:
    for row in rows:
        here, place = f"{path}:{row.line}", tuple(row[name] for name in PLACE)
        if place in owners:
            what = f"{row['case']} on {row['device']}"
            raise FreepathError(f"{here}: {what}: {owners[place]} has a row of it too")
        owners[place] = here


def _beside(found: Sequence[Path]) -> Iterator[tuple[Path, Path]]:
    """Files of each result, by their places in it; a link, which no run makes, is left out."""
    for one in found:
        for path in (path for pattern in BESIDE for path in sorted(one.glob(pattern))):
            place = path.relative_to(one)
            on_the_way = [one / part for part in (place, *place.parents[:-1])]
            if path.is_file() and not any(part.is_symlink() for part in on_the_way):
                yield place, path


def _joined(runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """run.json of all: the first one's, with the sessions, devices and cases of each."""
    joined = dict(runs[0])
    joined["sessions"] = [one for run in runs for one in _dicts(run, "sessions")]
    for name, key in LISTED:
        several = {str((one.get(key), one.get("device"))): one for run in runs
                   for one in _dicts(run, name)}  # fmt: skip
        joined[name] = list(several.values())
    return joined


def _dicts(run: dict[str, Any], name: str) -> list[dict[str, Any]]:
    found = run.get(name)
    return [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []


def _told(found: Sequence[Path], runs: Sequence[dict[str, Any]]) -> list[str]:
    told, shards, count = [], set(), 0
    for one, run in zip(found, runs, strict=True):
        *_, last = _dicts(run, "sessions") or [{}]
        if last.get("ended") != "complete":
            told.append(f"{one}: is not complete; `run --resume` goes on with it")
        if part := re.fullmatch(r"(\d{1,6})/(\d{1,6})", str(last.get("shard", ""))):
            shards.add(int(part[1]))
            count = max(count, int(part[2]))
    missing = sorted(set(range(1, count + 1)) - shards)
    if missing:
        told.append(f"shards missing of {count}: {', '.join(map(str, missing))}")
    return told
