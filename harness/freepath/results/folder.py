"""The folder of a run: summary.csv (a row a case), samples.csv (a row a round), run.json."""

from __future__ import annotations

import csv
import datetime
import errno
import json
import math
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from freepath.errors import FreepathError, ResultError, printable
from freepath.results import reading
from freepath.results.columns import COLUMNS, CONFIRM_COLUMNS, SAMPLE_COLUMNS, TEXTS

SCHEMA_VERSION = 6
SUMMARY, SAMPLES, CONFIRM, RUN = "summary.csv", "samples.csv", "confirm.csv", "run.json"
LONGEST_NAME = 4096
"""Bytes of a case's name."""
CHECKS = "checks.json"
"""What became of the checks of a tracker on trial."""
LOCK, AT_WORK = ".lock", ".at-work"
RESULTS = Path("results")
STAMP = "%Y%m%d-%H%M%S"
PLACE = ("case_id", "device", "platform")
"""What a row is about: a later row of the same place takes its place."""
KEY = (*PLACE, "driver_version", "config_sha256", "source_sha256")
"""A row of an interrupted run stands if all of these are what they would be now."""
SESSION = (*PLACE, "run_id")
"""What the rows of a case's rounds have in common with its own row."""
FINAL = ("ok", "skipped", "invalid", "mismatch", "crashed", "timeout")
"""Statuses that running again would only repeat."""

UMASK = os.umask(0o077)
os.umask(UMASK)

Row = reading.Row


class ResultFolder:
    """Writes a run's files; every row is on the disk as soon as its case is done."""

    def __init__(self, folder: Path, *, resume: bool = False, confirm: bool = False):
        """Look at the folder without touching it; `open` makes it ready to be written to.

        With `confirm`, a row that was measured stands only if its prediction was confirmed.
        Raises FreepathError if it holds a run and must not, or does not and must.
        """
        self.folder = folder
        self._resume = resume
        self._confirm = confirm
        self._lock: Any = None
        self._locked, self._at_work = 0, -1
        try:
            if folder.exists() and not folder.is_dir():
                raise FreepathError(f"{folder}: is a file, expected a folder for the results")
            holds = [name for name in (SUMMARY, SAMPLES, CONFIRM, RUN) if (folder / name).exists()]
        except OSError as error:
            raise FreepathError(f"{folder}: cannot be looked into: {error.strerror}") from error
        if resume and SUMMARY not in holds:
            raise FreepathError(f"{folder}: holds no run to resume (no {SUMMARY} there)")
        if holds and not resume:
            raise FreepathError(
                f"{folder}: already holds {', '.join(holds)}; "
                "go on with that run by --resume, or name another folder"
            )

    def open(
        self,
        planned: Sequence[Mapping[str, Any]],
        whole: Callable[[Row], bool] = lambda row: True,
        run_id: str = "",
    ) -> set[tuple[str, ...]]:
        """Make the folder, or take it over: rows that stand stay, rows to be made anew go.

        `planned` holds at least the KEY columns of every row that is wanted; returns the keys of
        those that are there already. Rows of other cases and devices are left alone, and those of
        the run `run_id` stand whatever became of their cases. `whole` says
        whether all files of a row are there; without them it does not stand.
        """
        wanted, places = {key_of(row) for row in planned}, {_of(row, PLACE) for row in planned}

        def stands(row: Row) -> bool:
            confirmed = needed is None or row["status"] != "ok" or _of(row, SESSION) in needed
            final = (row["status"] in FINAL or row["run_id"] == run_id) and confirmed
            return key_of(row) in wanted and final and whole(row)

        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._acquire()
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW
            self._at_work = os.open(self.folder / AT_WORK, flags, 0o666)
            old = self.rows() if self._resume else []
            predicted = self._old(CONFIRM, CONFIRM_COLUMNS)
            needed = {_of(row, SESSION) for row in predicted} if self._confirm else None
            kept = [row for row in old if stands(row) or _of(row, PLACE) not in places]
            sessions = {_of(row, SESSION) for row in kept}
            rounds = self._old(SAMPLES, SAMPLE_COLUMNS)
            reading.agree(self.folder / SUMMARY, old, rounds, SESSION)
            self.rewrite(SUMMARY, COLUMNS, kept)
            rounds = [row for row in rounds if _of(row, SESSION) in sessions]
            self.rewrite(SAMPLES, SAMPLE_COLUMNS, rounds)
            if predicted or self._confirm:
                stay = [row for row in predicted if _of(row, SESSION) in sessions]
                self.rewrite(CONFIRM, CONFIRM_COLUMNS, stay)
        except OSError as error:
            raise FreepathError(f"{self.folder}: cannot be written to: {error.strerror}") from error
        return {key_of(row) for row in kept if stands(row)}

    def _acquire(self) -> None:
        """Keep others from writing here; the system lets go of the lock when the process ends."""
        import filelock

        path = self.folder / LOCK
        if path.is_symlink():
            raise FreepathError(f"{path}: is a symbolic link, which no run makes; remove it")
        self._lock = filelock.FileLock(path)
        try:
            self._lock.acquire(timeout=0)
        except filelock.Timeout:
            raise FreepathError(f"{self.folder}: another freepath is writing there") from None
        self._locked = path.stat().st_ino

    def _check_lock(self) -> None:
        """Raise ResultError where the lock was removed, as another run may write here then."""
        path = self.folder / LOCK
        try:
            if self._lock and path.stat().st_ino != self._locked:
                raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        except OSError as error:
            raise _stopped(path, error) from error

    @property
    def holds_rows(self) -> bool:
        """Whether there is a summary, by whichever process it was written."""
        return (self.folder / SUMMARY).exists()

    def close(self) -> None:
        """Let others write here."""
        if self._lock:
            if self._at_work >= 0:
                os.close(self._at_work)
                self._at_work = -1
            (self.folder / AT_WORK).unlink(missing_ok=True)
            (self.folder / LOCK).unlink(missing_ok=True)
            self._lock.release()
            self._lock = None

    def note(self, case: str) -> None:
        """Note which case is at work, for who goes on where everything was killed."""
        with suppress(OSError):  # a full disk is told where a row is written
            os.pwrite(self._at_work, case.encode().ljust(LONGEST_NAME), 0)

    @property
    def noted(self) -> str:
        """The case that was at work when a run here was killed; '' where none was, or it ended."""
        with suppress(OSError):
            file = os.open(self.folder / AT_WORK, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
            with open(file, "rb") as opened:
                return printable(opened.read(LONGEST_NAME).decode(errors="replace").strip())
        return ""

    def _old(self, name: str, columns: tuple[str, ...]) -> list[Row]:
        """The rows of a file of the run that is gone on with."""
        path = self.folder / name
        return read_rows(path, columns) if self._resume and path.exists() else []

    def rewrite(self, name: str, columns: tuple[str, ...], rows: list[Row]) -> None:
        """Replace a file in one step, so that an interruption leaves the old or the new one."""
        with replacing(self.folder / name) as file:
            _writer(file, columns).writeheader()
            _writer(file, columns).writerows(rows)

    def append(
        self,
        row: Mapping[str, Any],
        rounds: Iterable[Mapping[str, Any]] = (),
        confirmed: Iterable[Mapping[str, Any]] = (),
    ) -> None:
        """Write a case's row and, before it, those of its rounds; both are on the disk then."""
        self._check_lock()
        self._append(SAMPLES, SAMPLE_COLUMNS, rounds)
        if self._confirm:
            self._append(CONFIRM, CONFIRM_COLUMNS, confirmed)
        self._append(SUMMARY, COLUMNS, [row])

    def _append(self, name: str, columns: tuple[str, ...], rows: Iterable[Mapping]) -> None:
        cells = [texts(row, columns) for row in rows]
        flags = os.O_WRONLY | os.O_APPEND | os.O_NOFOLLOW  # one that was removed is not made anew
        try:
            with open(
                self.folder / name,
                "a",
                newline="",
                encoding="utf-8",
                opener=lambda path, _: os.open(path, flags),
            ) as file:
                _writer(file, columns).writerows(cells)
                _flush(file)
        except OSError as error:
            raise _stopped(self.folder / name, error) from error

    def write_run(self, facts: Mapping[str, Any]) -> None:
        """Write run.json."""
        try:
            with replacing(self.folder / RUN) as file:
                file.write(json.dumps(facts, indent=1, allow_nan=False) + "\n")
        except OSError as error:
            raise _stopped(self.folder / RUN, error) from error

    def read_run(self) -> dict[str, Any]:
        """What run.json says; empty where there is none that can be read."""
        try:
            return reading.facts(self.folder / RUN)
        except FreepathError:
            return {}

    def write_log(self, name: str, text: str) -> Path:
        """Write a compiler's log beside the rows."""
        write(self.folder / name, text)
        return self.folder / name

    def rows(self) -> list[Row]:
        """All rows so far, as they stand in the file."""
        return read_rows(self.folder / SUMMARY)

    def confirmed(self) -> list[Row]:
        """Predicted and measured errors so far."""
        return read_rows(self.folder / CONFIRM, CONFIRM_COLUMNS)

    def paths(self) -> list[Path]:
        """The files of the run."""
        names = (SUMMARY, SAMPLES, *([CONFIRM] if self._confirm else []), RUN)
        return [self.folder / name for name in names]


def new_folder(name: str) -> Path:
    """A folder below results/ that is not there yet, named after the config and the time."""
    stem = f"{name}-{datetime.datetime.now().strftime(STAMP)}"
    numbered = (RESULTS / f"{stem}-{number}" for number in range(2, 1000))
    return next(path for path in (RESULTS / stem, *numbered) if not path.exists())


def newest_folder(name: str) -> Path:
    """The folder below results/ of the last run of a config; raises FreepathError without one."""
    stamped = re.compile(re.escape(name) + r"-[0-9]{8}-[0-9]{6}(-[0-9]+)?")
    found = [path for path in RESULTS.glob("*/") if stamped.fullmatch(path.name)]
    if not found:
        raise FreepathError(f"no run of {name} in {RESULTS}/ to resume; name its folder with -o")
    return max(found, key=lambda path: path.name)


def _writer(file: Any, columns: tuple[str, ...]) -> csv.DictWriter:
    return csv.DictWriter(file, columns, lineterminator="\n")


@contextmanager
def replacing(path: Path, mode: str = "w") -> Iterator[Any]:
    """A file to write text into (bytes: `wb`) that takes the place of `path` once all is written.

    A symbolic link there is replaced, and never followed: a folder may come from somebody else.
    """
    encoding, newline = (None, None) if "b" in mode else ("utf-8", "")
    with tempfile.NamedTemporaryFile(
        mode, dir=path.parent, prefix=".", encoding=encoding, newline=newline, delete=False
    ) as file:
        try:
            os.fchmod(file.fileno(), 0o666 & ~UMASK)
            yield file
            _flush(file)
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise


def write(path: Path, text: str) -> None:
    """Write a text file in the place of what is there."""
    with replacing(path) as file:
        file.write(text)


def _stopped(path: Path, error: OSError) -> ResultError:
    why = error.strerror
    if isinstance(error, FileNotFoundError):
        why = "was removed while a run writes there"
    hint = "rows that were finished stand; go on by --resume"
    return ResultError(f"{path}: {why}; {hint}")


def _flush(file: Any) -> None:
    file.flush()
    os.fsync(file.fileno())


def _of(row: Mapping[str, Any], columns: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(row[column] for column in columns)


def key_of(row: Mapping[str, Any]) -> tuple[str, ...]:
    """What must agree for a row to stand for a case."""
    return _of(row, KEY)


def texts(row: Mapping[str, Any], columns: tuple[str, ...]) -> dict[str, str]:
    """The cells of a row; texts command neither a terminal nor a spreadsheet."""
    cells = {column: _text(row[column]) for column in columns}
    return cells | {name: no_formula(printable(cells[name])) for name in TEXTS & cells.keys()}


FORMULA = ("=", "+", "-", "@", "\t", "\r")


def no_formula(text: str) -> str:
    """A text that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text


def _unquoted(text: str) -> str:
    """What `no_formula` was given."""
    return text[1:] if text[:1] == "'" and text.startswith(FORMULA, 1) else text


def _text(value: Any) -> str:
    """None is empty; floats in full; inf as the word that every reader of CSV knows."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    # of numpy's floats too, whose repr names their type
    return repr(float(value)) if isinstance(value, float) else str(value)


def read_rows(path: Path, columns: tuple[str, ...] = COLUMNS) -> list[Row]:
    """Read a CSV of a run; a last row that was cut off by a crash is left out.

    Raises FreepathError, with file, line and column, for what no run has written.
    """
    found = reading.rows(path, columns, TEXTS, SCHEMA_VERSION)
    for row in found:
        row.update((name, _unquoted(row[name])) for name in TEXTS & row.keys())
    return found


def read_result(folder: Path) -> tuple[list[Row], list[Row]]:
    """The rows of cases and of rounds; raises FreepathError where they do not agree."""
    cases, samples = read_rows(folder / SUMMARY), folder / SAMPLES
    rounds = read_rows(samples, SAMPLE_COLUMNS) if samples.exists() else []
    if samples.exists():
        reading.agree(folder / SUMMARY, cases, rounds, SESSION)
    return cases, rounds


def records(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Rows with numbers as numbers and empty cells as None; inf stays a word, as JSON has none."""
    return [{column: _value(column, text) for column, text in row.items()} for row in rows]


def _value(column: str, text: str) -> Any:
    if text == "":
        return None
    if column in TEXTS:
        return text
    value = float(text)
    if not math.isfinite(value):
        return text
    return int(text) if text.isdigit() else value
