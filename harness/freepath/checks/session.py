"""A run of checks: on each device in processes of its own, reported as it goes on."""

from __future__ import annotations

import textwrap
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace

from freepath.checks import printing
from freepath.checks.model import Check
from freepath.checks.outcome import Outcome
from freepath.checks.pool import Pool, Task
from freepath.checks.worker import Setting
from freepath.device import drivers
from freepath.device.opencl import DeviceInfo
from freepath.device.selection import selector_of

Chosen = Sequence[tuple[int, Check]]


@dataclass(frozen=True)
class Options(Setting):
    """How checks are run, and what is reported of them."""

    parallel: int = 1
    timeout: float = 300.0
    repeat: int = 1
    stop_on_failure: bool = False
    output_on_failure: bool = False
    verbose: bool = False

    @classmethod
    def of(cls, options: Namespace) -> Options:
        """Those of the command line that are given; the device is each session's own."""
        names = {one.name for one in fields(cls)} - {"device"}
        return cls(**{k: v for k, v in vars(options).items() if k in names and v is not None})


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
        seen = drivers.current()
        seen_name = seen.name if seen else ""
        options = replace(self.options, device=selector_of(info), driver=seen_name)
        ended = self.outcomes.setdefault(info.label, [])
        tasks = [
            Task(number, check, repeat)
            for repeat in range(options.repeat)
            for number, check in self.chosen
        ]
        progress = printing.Progress(self.chosen, len(tasks))

        def started(task: Task) -> None:
            self.tell(progress.start(task.number, task.check.name))

        for one in Pool(options, options.parallel, options.timeout, started).outcomes(tasks):
            outcome = one
            if one.wrong and one.repeat:
                # it fails again with its seed
                text = f"--seed {options.seed_of(one.repeat)}: {one.text}"
                outcome = replace(one, text=text)
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
