"""What repeats of checks with fresh seeds say of the checks themselves."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

from freepath.checks.model import BUDGET
from freepath.checks.outcome import Outcome
from freepath.checks.verdict import sidak

SMALL = (1e-2, 1e-3, 1e-4)
"""Levels at which p-values are counted; at the first also those of each check."""
SUSPECT = 1e-3
"""The chance that a check is named although its p-values are what chance gives, of all together."""


def of_devices(
    by_device: Mapping[str, Sequence[Outcome]], repeats: int, *, stopped: bool = False
) -> tuple[str, bool]:
    """What repeats say of each device, and whether one had too many false alarms.

    All repeats of one kernel come first, so none is whole where they were stopped: their p-values
    are reported then, but no rate.
    """
    told, wrong = [], False
    for device, outcomes in by_device.items():
        if stopped:
            text = "stopped, so no run is whole and the rate of false alarms is unknown.\n"
            text, too_many = text + alarms(outcomes), False
        else:
            text, too_many = false_alarms(outcomes, repeats)
        told.append(f"{device}: {text}\n{small_p_values(outcomes)}")
        wrong |= too_many
    return "\n\n".join(told), wrong


def alarms(outcomes: Sequence[Outcome]) -> str:
    """How many verdicts were alarms."""
    return f"{sum(one.wrong for one in outcomes)} of {len(outcomes)} verdicts were alarms."


def false_alarms(outcomes: Sequence[Outcome], repeats: int) -> tuple[str, bool]:
    """What repeats with fresh seeds say of false alarms, and whether there are too many.

    Of a right device a run fails with the chance BUDGET at most; too many is what has a chance
    below 1 in 1000 then.
    """
    alarmed = {one.repeat for one in outcomes if one.wrong}
    test = stats.binomtest(len(alarmed), repeats, BUDGET, alternative="greater")
    interval = stats.binomtest(len(alarmed), repeats).proportion_ci(0.95, "exact")
    text = (
        f"{len(alarmed)} of {repeats} runs with fresh seeds raised an alarm "
        f"({len(alarmed) / repeats:.2g}, 95 % interval {interval.low:.2g} to {interval.high:.2g}); "
        f"the budget is {BUDGET:g} a run.\n"
        f"{alarms(outcomes)}"
    )
    return text, bool(test.pvalue < 1e-3)


def small_p_values(outcomes: Sequence[Outcome]) -> str:
    """Whether p-values are as small as often as they say; and the checks of which they are not.

    Alarms are far too rare to show it: a test with a wrong distribution shows in p-values first.
    """
    by_name: dict[str, list[float]] = defaultdict(list)
    for one in outcomes:
        if one.p_value is not None:
            by_name[one.name].append(one.p_value)
    if not by_name:
        return "None of these checks tests a distribution."
    found = np.concatenate([np.array(values) for values in by_name.values()])
    counts = [
        f"{np.count_nonzero(found < level)} below {level:g} (expected {len(found) * level:.3g})"
        for level in SMALL
    ]
    lines = [f"p-values of {len(found)} verdicts: {', '.join(counts)}."]
    level = sidak(SUSPECT, len(by_name))
    for name, values in by_name.items():
        small = int(np.count_nonzero(np.array(values) < SMALL[0]))
        chance = float(stats.binom.sf(small - 1, len(values), SMALL[0]))
        if chance < level:
            text = f"{small} of {len(values)} below {SMALL[0]:g}, a chance of {chance:.2g}"
            lines.append(f"  too small too often: {name}: {text}")
    return "\n".join(lines)
