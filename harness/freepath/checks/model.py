"""What a check is, and the share that each has of the budget of error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from freepath.checks.rig import Rig
from freepath.checks.verdict import sidak
from freepath.compose.catalog import Tracker
from freepath.device.opencl import DeviceInfo

BUDGET = 1e-3
"""The chance that a run of all checks rejects a right device, whatever it draws."""
MOST_CHECKS = 2000
"""The budget is shared out to so many, more than there are: so what a check says depends neither on
what else is selected nor on which trackers were added."""
LEVEL = sidak(BUDGET, MOST_CHECKS)

TINY = "tiny"
FURTHER = frozenset((
    *("biased_march", "collision", "decomposition_factored", "hybrid"),
    *("jackknife", "jackknife_placed", "production_march", "resampled"),
))  # fmt: skip
"""Trackers of which the tests hold what is derived and no more: their walks and media are those of
relatives. The rest is slow, for `freepath check`."""
GROUPS = (
    *("random-numbers", "empty-full", "thin", "thick", "non-bounding", "loose", "residual"),
    *("geometry", "scale", "contrast", "accumulation", "long-runs", "scattering", "p_absorb"),
    *("channels", "bad-input"),
)
"""The hard cases, by group: each is a label."""
KINDS = ("smoke", "identity", "distribution", "moments", "hard")
LABELS = ("fast", "slow", "minutes", TINY, *KINDS, *GROUPS)
"""What -L finds, as docs/checks.md explains it; a tracker's name is a label of its checks too."""


def always(info: DeviceInfo) -> str:
    """No reason not to."""
    return ""


def needs_double(info: DeviceInfo) -> str:
    """The reason where a device has no double precision."""
    return "" if info.fp64 else "the device has no double precision"


@dataclass(frozen=True)
class Check:
    """One tracker, sampler, generator or walk in one situation."""

    name: str
    labels: tuple[str, ...]
    sentence: str
    """What would go wrong without the care taken."""
    run: Callable[[Rig, float], None]
    """Raises Failure where it finds something wrong, with the given chance where nothing is."""
    applies: Callable[[DeviceInfo], str] = always
    """The reason why it cannot be made on a device, or ''."""
    kernels: str = field(default="", compare=False)
    """Checks of the same ones are run by the same process, which compiles them once."""

    @classmethod
    def of(
        cls, name: str, labels: tuple[str, ...], function: Callable[..., None], /, **options: Any
    ) -> Check:
        """A check whose `run` calls a function with `options`; its docstring is the sentence.

        But for `sentence`, `applies` and `kernels`, which are the check's own.
        """
        own = {key: options.pop(key) for key in ("applies", "kernels") if key in options}
        sentence = options.pop("sentence", function.__doc__ or "")
        if FURTHER.intersection(labels) and not {"moments", TINY}.intersection(labels):
            labels = ("slow", *(label for label in labels if label != "fast"))
        return cls(name, labels, " ".join(sentence.split()), partial(function, **options), **own)

    def reason_against(self, info: DeviceInfo) -> str:
        """Why it cannot be made on a device, or ''."""
        if info.interpreted and TINY not in self.labels:
            return "an interpreter gets checks with the label tiny, and no others"
        return self.applies(info)

    @property
    def in_tests(self) -> bool:
        """Whether the tests run it too: what is fast."""
        return "fast" in self.labels


def majorant_of(tracker: Tracker, wanted: str = "grid") -> str:
    """The majorant that a tracker is checked with: the wanted one, or what it can do with."""
    if "majorant" not in tracker.needs or wanted not in tracker.majorants:
        return "global"
    return wanted


def is_bounding(tracker: Tracker) -> bool:
    """Whether a tracker, with its default parameters, needs a majorant that bounds."""
    if isinstance(tracker.bounding, bool):
        return tracker.bounding
    return any(
        tracker.parameters[name].default in given for name, given in tracker.bounding.items()
    )
