"""What became of a check on a device."""

from __future__ import annotations

from dataclasses import dataclass

PASSED, FAILED, TIMEOUT, CRASHED, SKIPPED = "Passed", "Failed", "Timeout", "Crashed", "Skipped"
WRONG = (FAILED, TIMEOUT, CRASHED)


@dataclass(frozen=True)
class Outcome:
    """How it ended, after how many seconds, and what it said."""

    number: int
    name: str
    labels: tuple[str, ...]
    status: str
    seconds: float
    text: str = ""
    repeat: int = 0
    p_value: float | None = None
    """How likely its tests find something so unlikely by chance; None where it makes none."""

    @property
    def wrong(self) -> bool:
        return self.status in WRONG
