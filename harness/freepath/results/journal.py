"""Which case is at work, so that a run that goes on gets past what ended its process."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from freepath.errors import FreepathError

FILE = "at-work.json"
TWICE = 2
"""So often a process may end at a case before that is given up: once may have been a power cut."""


class Journal:
    """The file of a folder that names the case at work; one that is left shows a process's end.

    Cases are known by the texts of a key.
    """

    def __init__(self, folder: Path):
        self._path = folder / FILE
        self._deaths: dict[str, int] = {}
        self._at_work = ""
        self._file: Any = None

    def open(self) -> None:
        """Count the end of the last process, if it came at work."""
        self._deaths = self._left()
        self._write()

    def _left(self) -> dict[str, int]:
        try:
            found = json.loads(self._path.read_text("utf-8"))
            deaths = {str(case): int(count) for case, count in found["deaths"].items()}
            at_work = str(found["at_work"])
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return {}
        return deaths | ({at_work: deaths.get(at_work, 0) + 1} if at_work else {})

    def deaths_at(self, key: Sequence[str]) -> int:
        """How often a process ended while this case was at work."""
        return self._deaths.get(_name(key), 0)

    def work_at(self, key: Sequence[str]) -> None:
        """Call it before anything of a case is built or launched."""
        name = _name(key)
        if name != self._at_work:
            self._at_work = name
            self._write()

    def done(self, place: Sequence[str]) -> None:
        """There is a row for what begins a key; nothing is held against it, in any version."""
        others = {
            key: count for key, count in self._deaths.items() if not key.startswith(_name(place))
        }
        self._deaths = others

    def close(self) -> None:
        """The process ends in order; the file stays while a case is held to have ended one."""
        self._at_work = ""
        self._write()
        self._file.close()
        self._file = None
        if not self._deaths:
            self._path.unlink(missing_ok=True)

    def _write(self) -> None:
        text = json.dumps({"at_work": self._at_work, "deaths": self._deaths})
        try:
            # kept open: between two rounds there is no time for opening and emptying a file
            self._file = self._file or self._path.open("w", encoding="utf-8")
            self._file.seek(0)
            self._file.write(text)
            self._file.truncate()
            self._file.flush()
        except OSError as error:
            raise FreepathError(f"{self._path}: cannot be written: {error.strerror}") from error


def _name(key: Sequence[str]) -> str:
    return "".join(f"{text} | " for text in key)
