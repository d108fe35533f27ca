"""What a check is, and the share that each has of the budget of error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from freepath.catalog import Tracker
from freepath.check.rig import Rig
from freepath.check.verdict import sidak
from freepath.device import DeviceInfo

BUDGET = 1e-3
"""The chance that a run of all checks rejects a right device, whatever it draws."""
MOST_CHECKS = 2000
"""The budget is shared out to so many, more than there are: so what a check says depends neither on
what else is selected nor on which trackers were added."""
LEVEL = sidak(BUDGET, MOST_CHECKS)

TINY = "tiny"
GROUPS = {
    "random-numbers": "generators, and samplers at the ends of their domain",
    "empty-full": "nothing, one voxel, and all voxels alike",
    "thin": "optical depths of 1e-7 and 1e-12",
    "thick": "optical depths of 50, a thousand and a million",
    "non-bounding": "majorants below the extinction",
    "loose": "majorants a thousand and a million times too high",
    "residual": "null collisions and controls where nothing is left over",
    "geometry": "rays along axes, faces and edges, through corners, without length",
    "scale": "units and places",
    "contrast": "neighbours of 0 and a million, denormal densities, half floats",
    "accumulation": "a thousand million samples",
    "long-runs": "numbers beyond 32 bits, launches that are cut",
    "scattering": "furnaces, emission, phase functions, lights beside a ray and far away",
    "p_absorb": "paths absorbed with a chance of one's choice: none, some, as the albedo says",
    "channels": "several channels on one path: a thousand to one, nothing, their albedos",
    "bad-input": "volumes that must be refused",
}
"""The hard cases, by group: each is a label."""
LABELS = {
    "fast": "takes little time together: the first thing to run",
    "slow": "the rest",
    "minutes": "takes minutes alone",
    TINY: "so little that an interpreter of kernels gets through it",
    "smoke": "each tracker, a few paths",
    "identity": "means agree with float64",
    "distribution": "free paths have the distribution of the medium",
    "moments": "variances and costs agree with what is known of them",
    "hard": "what breaks trackers in float32",
    **GROUPS,
}
"""What -L finds; the name of its tracker is a label of a check too."""


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
        return cls(name, labels, " ".join(sentence.split()), partial(function, **options), **own)

    def reason_against(self, info: DeviceInfo) -> str:
        """Why it cannot be made on a device, or ''."""
        if info.interpreted and TINY not in self.labels:
            return "an interpreter gets checks with the label tiny, and no others"
        return self.applies(info)

    @property
    def in_tests(self) -> bool:
        """Whether the tests run it too: all but those that take minutes."""
        return "minutes" not in self.labels


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
