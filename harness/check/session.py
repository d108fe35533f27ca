"""A run of checks: on each device in processes of its own, told as it goes on."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from freepath import drivers
from freepath.check import printing
from freepath.check.model import Check
from freepath.check.outcome import Outcome
from freepath.check.pool import Pool, Task
from freepath.check.worker import Setting
from freepath.device import DeviceInfo
from freepath.selection import selector_of

Chosen = Sequence[tuple[int, Check]]


@dataclass(frozen=True)
class Options:
    """How checks are run, and what is told of them."""

    processes: int = 1
    timeout: float = 300.0
    repeat: int = 1
    seed: int | None = None
    trackers: Sequence[Path] = ()
    arithmetic: str = "strict"
    storage: str = "float"
    stop_on_failure: bool = False
    output_on_failure: bool = False
    verbose: bool = False


@dataclass
class Session:
    """Runs checks on one device after the other."""

    chosen: Chosen
    options: Options
    tell: Callable[[str], None]
    outcomes: dict[str, list[Outcome]] = field(default_factory=dict)
    """By the device's label, as they end."""

    def run(self, info: DeviceInfo) -> list[Outcome]:
        """Run all on a device; raises DeviceError where it cannot be used at all."""
        options = self.options
        ended = self.outcomes.setdefault(info.label, [])
        tasks = [
            Task(number, check, repeat)
            for repeat in range(options.repeat)
            for number, check in self.chosen
        ]
        progress = printing.Progress(self.chosen, len(tasks))
        setting = Setting(
            selector_of(info),
            seen.name if (seen := drivers.current()) else "",
            trackers=tuple(options.trackers),
            arithmetic=options.arithmetic,
            storage=options.storage,
        )
        if options.seed is not None:
            setting = replace(setting, seed=options.seed)
        pool = Pool(
            setting,
            options.processes,
            options.timeout,
            lambda task: self.tell(progress.start(task.number, task.check.name)),
        )
        for outcome in map(partial(_with_seed, setting), pool.outcomes(tasks)):
            ended.append(outcome)
            self.tell(progress.end(outcome))
            self._tell_output(outcome)
            if outcome.wrong and options.stop_on_failure:
                break
        return ended

    def _tell_output(self, outcome: Outcome) -> None:
        check = next(check for number, check in self.chosen if number == outcome.number)
        if self.options.verbose:
            self.tell(textwrap.indent(textwrap.fill(check.sentence, 90), "    "))
        wanted = self.options.output_on_failure and outcome.wrong
        if outcome.text and (wanted or self.options.verbose):
            self.tell(textwrap.indent(outcome.text.rstrip(), "    "))

    @property
    def failed(self) -> list[str]:
        """The names of the checks that failed on any device."""
        wrong = (one.name for ended in self.outcomes.values() for one in ended if one.wrong)
        return list(dict.fromkeys(wrong))


def _with_seed(setting: Setting, outcome: Outcome) -> Outcome:
    """What failed in a repeat says with which seed it fails again."""
    if not (outcome.wrong and outcome.repeat):
        return outcome
    return replace(outcome, text=f"--seed {setting.seed_of(outcome.repeat)}: {outcome.text}")
