"""What the compilers of drivers say: kept away from the terminal, and its error put first."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

REASON_LENGTH = 300
PLACE = re.compile(r"(?:error: )?([\w./-]+):(\d+):(\d+): (?:error: )?(?!warning)(.*)")
"""An error with its file, line and column, as clang and PoCL write it."""
COMPILERS_SAY = re.compile(r"(\d+ warnings? generated\.|)\s*")
"""Lines of a compiler's output that are of no use to anybody."""


def first_error(error: Exception) -> str:
    """The line of a compiler's log or a driver's message that says what is wrong."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    naming = [line for line in lines if re.search(r"\berror:", line, re.IGNORECASE)]
    placed = [m for line in lines if (m := PLACE.match(line))]
    if placed:
        return "{}:{}:{}: error: {}".format(*placed[0].groups())[:REASON_LENGTH]
    return (naming or lines)[0][:REASON_LENGTH]


def told_first(log: str, source: str) -> str:
    """A compiler's log, with the error, its place and the line of the source at its beginning."""
    error = first_error(Exception(log))
    found = PLACE.match(error)
    if not found:
        return f"{error}\n{log}"
    name, line, column = found[1], int(found[2]), int(found[3])
    part = source.partition(f'#line 1 "{name}"\n')[2].splitlines()
    shown = f"\n    {part[line - 1]}\n    {' ' * (column - 1)}^" if line <= len(part) else ""
    return f"{error}{shown}\n{log}"


def _itself(path: str, flags: int) -> int:
    """Open a file, but none that a symbolic link leads to: a folder may be from somebody else."""
    return os.open(path, flags | os.O_NOFOLLOW, 0o666)


@contextmanager
def compilers_into(log: Path | None) -> Iterator[None]:
    """Let what compilers and drivers print while they build go into a file, or nowhere.

    They write to file descriptor 2 past Python. What they print before a crash is in the file.
    """
    sys.stderr.flush()
    before = os.dup(2)
    with open(log, "a+b", opener=_itself) if log else tempfile.TemporaryFile() as printed:
        start = printed.seek(0, os.SEEK_END)
        try:
            os.dup2(printed.fileno(), 2)
            yield
        finally:
            os.dup2(before, 2)
            os.close(before)
            printed.seek(start)
            lines = printed.read().decode("utf-8", "replace").splitlines()
            if all(COMPILERS_SAY.fullmatch(line) for line in lines):
                printed.truncate(start)
    if log and not log.stat().st_size:
        log.unlink()
