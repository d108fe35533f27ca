"""Checks on drivers that each need a process of their own: run there, and put together here."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from freepath.checks.outcome import Outcome
from freepath.device import drivers
from freepath.device.selection import Parts, selector_of
from freepath.errors import FAILED

ByDevice = dict[str, list[Outcome]]


def write(path: Path, by_device: ByDevice, unusable: Sequence[str]) -> None:
    """Hand what a process found to the one that started it."""
    found = {label: [asdict(one) for one in ended] for label, ended in by_device.items()}
    path.write_text(json.dumps({"outcomes": found, "unusable": list(unusable)}), "utf-8")


def read(path: Path) -> tuple[ByDevice, list[str]]:
    """What `write` wrote."""
    found = json.loads(path.read_text("utf-8"))
    by_device = {
        label: [Outcome(**one | {"labels": tuple(one["labels"])}) for one in ended]
        for label, ended in found["outcomes"].items()
    }
    return by_device, found["unusable"]


def run(
    parts: Parts,
    arguments: Sequence[str],
    tell: Callable[[str], None],
) -> Iterator[tuple[ByDevice, list[str], int]]:
    """Run `freepath check ARGUMENTS` for each driver; yields outcomes, what is unusable, exit code.

    A driver whose process ends without a word is unusable; those after it still run.
    """
    for driver, infos, failure in parts:
        if failure:
            yield {}, [f"{driver.name} cannot be used here: {failure}"], FAILED
            continue
        tell(f"{driver.name}: {driver.title}")
        with tempfile.TemporaryDirectory(prefix="freepath-check-") as folder:
            path = Path(folder) / "outcomes.json"
            chosen = [word for info in infos for word in ("-d", selector_of(info))]
            command = ["check", *arguments, *chosen, "--outcomes", str(path)]
            code = drivers.in_process_of(driver, command).returncode
            if path.exists():
                yield *read(path), code
            else:
                why = f"{driver.name}: {drivers.how_it_ended(code)}"
                yield {}, [why], FAILED if code < 0 else code
