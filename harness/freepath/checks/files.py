"""What `freepath check` writes: JUnit, a file for ctest, and which checks failed last."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from freepath.checks.model import Check
from freepath.checks.outcome import FAILED, SKIPPED, Outcome
from freepath.errors import UsageError
from freepath.scene.cache import cache_dir

FAILED_LAST = "LastTestsFailed.log"


def write_junit(path: Path | None, by_device: dict[str, list[Outcome]]) -> None:
    """A suite a device, if there is a path; raises UsageError where it cannot be written."""
    if path is None:
        return
    from junitparser import Error, JUnitXml, Skipped, TestCase, TestSuite
    from junitparser import Failure as Wrong

    report = JUnitXml("freepath check")
    for device, outcomes in by_device.items():
        suite, cases = TestSuite(device), []
        for outcome in outcomes:
            name = f"{outcome.name} (repeat {outcome.repeat})" if outcome.repeat else outcome.name
            case = TestCase(name, "freepath.checks", outcome.seconds)
            text = _printable(outcome.text)
            message = text.strip().splitlines()[-1] if text.strip() else outcome.status
            if outcome.status == SKIPPED:
                case.result = [Skipped(message)]
            elif outcome.wrong:
                kind = Wrong if outcome.status == FAILED else Error
                case.result = [kind(message, outcome.status)]
                case.system_out = text
            cases.append(case)
        # all at once: each call counts the whole suite again
        suite.add_testcases(cases)
        report.add_testsuite(suite)
    report.update_statistics()
    with _written(path):
        report.write(str(path), pretty=True)


def _printable(text: str) -> str:
    """Without the control characters that XML does not allow."""
    return re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", text)


@contextmanager
def _written(path: Path) -> Iterator[None]:
    """Make a folder for it; what the file system refuses is a UsageError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error


def write_ctest(
    folder: Path, chosen: Sequence[tuple[int, Check]], arguments: Sequence[str], timeout: float
) -> Path:
    """Write a CTestTestfile.cmake of which each test is one check; returns its path."""
    command = [sys.executable, "-m", "freepath", "check", *arguments]
    lines = ["# Written by `freepath check --ctest`: run `ctest` in this folder."]
    for _, check in chosen:
        parts = [*command, "-R", f"^{re.escape(check.name)}$"]
        quoted = " ".join(_bracketed(part) for part in parts)
        labels = ";".join(check.labels)
        lines += [
            f"add_test({_bracketed(check.name)} {quoted})",
            f"set_tests_properties({_bracketed(check.name)} PROPERTIES LABELS {_bracketed(labels)}"
            # its own timeout is to be the one that is met
            f" TIMEOUT {timeout + 60:g} SKIP_REGULAR_EXPRESSION [=[\\*\\*\\*Skipped]=])",
        ]
    path = folder / "CTestTestfile.cmake"
    with _written(path):
        path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def _bracketed(text: str) -> str:
    """A bracket argument: nothing in it is special to CMake."""
    level = "="
    while f"]{level}]" in text:
        level += "="
    return f"[{level}[{text}]{level}]"


def failed_last() -> set[str]:
    """The names of the checks that failed in the last run; raises UsageError where none was."""
    path = cache_dir() / "check" / FAILED_LAST
    try:
        return set(path.read_text("utf-8").split())
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError("--rerun-failed: there is no run before this one") from error


def keep_failed(names: Sequence[str]) -> None:
    """Remember which checks failed; a cache that cannot be written is done without."""
    folder = cache_dir() / "check"
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / f"{FAILED_LAST}.{os.getpid()}"
        part.write_text("".join(f"{name}\n" for name in names), "utf-8")
        part.replace(folder / FAILED_LAST)
