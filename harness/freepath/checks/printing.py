"""What `freepath check` prints: the text of ctest."""

from __future__ import annotations

import textwrap
from collections import Counter, defaultdict
from collections.abc import Sequence

from freepath.checks.model import Check
from freepath.checks.outcome import PASSED, SKIPPED, Outcome

SHOWN = {"Passed": "   Passed  ", "Crashed": "***Exception: Crash "}


def listing(chosen: Sequence[tuple[int, Check]], *, verbose: bool) -> str:
    """The checks selected, as of -N; with their sentences and labels as of -N -V."""
    width = len(str(max(number for number, _ in chosen)))
    lines = []
    for number, check in chosen:
        if verbose:
            lines.append(f"Labels: {' '.join(check.labels)}")
        lines.append(f"  Test {f'#{number}':>{width + 2}}: {check.name}")
        if verbose:
            lines.append(textwrap.indent(textwrap.fill(check.sentence, 90), " " * (width + 11)))
    return "\n".join([*lines, "", f"Total Tests: {len(chosen)}"])


class Progress:
    """The lines of a run: one as a test starts, one as it ends."""

    def __init__(self, checks: Sequence[tuple[int, Check]], total: int):
        self._total = total
        self._done = 0
        self._number_width = len(str(max(number for number, _ in checks)))
        self._name_width = max(len(check.name) for _, check in checks)

    def start(self, number: int, name: str) -> str:
        return f"      Start {number:>{self._number_width}}: {name}"

    def end(self, outcome: Outcome) -> str:
        self._done += 1
        width = len(str(self._total))
        name = f"{outcome.name} ".ljust(self._name_width + 4, ".")
        status = SHOWN.get(outcome.status, f"***{outcome.status}").ljust(11)
        count = f"{self._done:>{width}}/{self._total}"
        number = f"#{outcome.number}".rjust(self._number_width + 2)
        return f"{count} Test {number}: {name}{status}{outcome.seconds:6.2f} sec"


def summary(outcomes: Sequence[Outcome], seconds: float) -> str:
    """How many passed, times by label, what was skipped and what failed."""
    ran = [outcome for outcome in outcomes if outcome.status != SKIPPED]
    failed = [outcome for outcome in ran if outcome.wrong]
    # never rounded up to all of them
    share = int(100 * (len(ran) - len(failed)) / len(ran)) if ran else 100
    lines = ["", f"{share}% tests passed, {len(failed)} tests failed out of {len(ran)}"]
    lines += ["", *_times(ran), "", f"Total Test time (real) = {seconds:6.2f} sec"]
    skipped = [outcome for outcome in outcomes if outcome.status == SKIPPED]
    if skipped:
        lines += ["", "The following tests did not run:"]
        lines += _listed([(one, f"Skipped: {one.text}") for one in skipped])
    if failed:
        lines += ["", "The following tests FAILED:"]
        lines += _listed([(one, one.status) for one in failed])
    return "\n".join(lines)


def _listed(outcomes: Sequence[tuple[Outcome, str]]) -> list[str]:
    """Each once, with what is said of it; of repeats how many."""
    counts = Counter((one.number, one.name, said) for one, said in outcomes)
    return [
        f"\t{number:>3} - {name} ({said})" + (f", {count} times" if count > 1 else "")
        for (number, name, said), count in counts.items()
    ]


def _times(outcomes: Sequence[Outcome]) -> list[str]:
    by_label: dict[str, list[float]] = defaultdict(list)
    for outcome in outcomes:
        for label in outcome.labels:
            by_label[label].append(outcome.seconds)
    width = max(map(len, by_label), default=0)
    lines = [
        f"{label:<{width}} = {sum(times):7.2f} sec*proc ({len(times)} tests)"
        for label, times in sorted(by_label.items())
    ]
    return ["Label Time Summary:", *lines] if lines else []


def matrix(by_device: dict[str, list[Outcome]]) -> str:
    """Check x device: P passed, F failed (T timed out, C crashed), - not applicable, and why."""
    devices = list(by_device)
    lines = [f"{chr(ord('A') + i)} = {device}" for i, device in enumerate(devices)] + [""]
    found = {device: _worst(outcomes) for device, outcomes in by_device.items()}
    names = list(dict.fromkeys(name for outcomes in found.values() for name in outcomes))
    width = max(map(len, ["check", *names]))
    header = " ".join(chr(ord("A") + i) for i in range(len(devices)))
    lines.append(f"{'check':<{width}}  {header}")
    reasons: dict[str, list[str]] = defaultdict(list)
    for name in names:
        cells = []
        for i, device in enumerate(devices):
            one = found[device].get(name)
            cells.append(_cell(one))
            if one and one.status != PASSED and one.text:
                reasons[one.text.strip().splitlines()[-1]].append(f"{chr(ord('A') + i)} {name}")
        lines.append(f"{name:<{width}}  {' '.join(cells)}")
    lines += ["", "P passed, F failed, T timeout, C crashed, - not applicable, ? did not run"]
    for reason, where in reasons.items():
        more = f" and {len(where) - 3} more" if len(where) > 3 else ""
        lines.append(f"  {reason}: {', '.join(where[:3])}{more}")
    return "\n".join(lines)


def _worst(outcomes: Sequence[Outcome]) -> dict[str, Outcome]:
    """By name; of repeats the last that failed, if any did."""
    return {one.name: one for one in sorted(outcomes, key=lambda one: one.wrong)}


def _cell(outcome: Outcome | None) -> str:
    if outcome is None:
        return "?"
    return "-" if outcome.status == SKIPPED else outcome.status[0]
