"""What a sweep answers, in a sentence: which case is the fastest, by how much, and how biased."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from freepath.measure.ladder import Ladder
from freepath.show.table import Row, number, settled, soonest, uncertainty

USUAL = ("delta", "global", 1.0)
"""Tracker, majorant and tightness that ratios are of, where nothing else is asked for."""
COLUMNS = ("time_to_1pct_s", "time_per_sample_s", "time_noise", "variance_noise")
ROUNDING = 1e-6
"""Relative RMS of a bias that the rounding of floats may cause: none that is measurable."""


@dataclass(frozen=True)
class Case:
    """A case that reaches an accuracy."""

    case: str
    """Its name in results."""
    tracker: str
    label: str
    """The tracker with its parameters."""
    majorant: str
    tightness: float | None
    time_s: float
    """Device seconds of a ray to the accuracy."""
    noise: float
    """Half the 95 % interval of the time, relative to it."""
    bias: float
    """RMS over rays, relative to the reference."""

    @property
    def name(self) -> str:
        """As a sentence has it."""
        label = re.sub(r"\d+\.\d{4,}", lambda found: f"{float(found[0]):.4g}", self.label)
        if self.majorant in ("none", ""):
            return label
        return f"{label}, {self.majorant.replace('-', ' ')}, tightness {self.tightness:g}"

    @property
    def settled(self) -> bool:
        """Whether its time is known well enough to be ranked."""
        return settled(self.noise)

    @property
    def biased(self) -> bool:
        """Whether its bias was measured to be above what rounding causes."""
        return self.bias > ROUNDING


def case_of(row: Row, time: tuple[float, float] | None = None) -> Case | None:
    """A row of summary.csv with its time to 1 %, or with a time and its uncertainty.

    None where it failed, or does not reach the accuracy.
    """
    seconds, *others = (number(row, name) for name in COLUMNS)
    if row["status"] != "ok" or (time is None and seconds is None):
        return None
    seconds, noise = time or (seconds, uncertainty(seconds, *others))
    if math.isinf(seconds):
        return None
    reference, tightness = number(row, "reference"), number(row, "tightness")
    bias = (number(row, "bias_rms") or 0.0) / abs(reference) if reference else 0.0
    parts = row["case"], row["tracker"], row["tracker_label"], row["majorant"], tightness
    return Case(*parts, seconds, noise, bias)


def at_accuracy(row: Row, accuracy: float) -> Case | None:
    """A row with the device seconds per ray to a relative RMSE; None where it does not reach it."""
    variance, scale = number(row, "variance"), number(row, "reference")
    scale = number(row, "estimate") if scale is None else scale
    time = number(row, "time_per_sample_s")
    if row["status"] != "ok" or variance is None or not scale or not time:
        return None
    bias = number(row, "bias_rms") or 0.0
    needs = Ladder(bias, variance, time).time_to(accuracy * abs(scale))
    noises = number(row, "time_noise"), number(row, "variance_noise")
    return case_of(row, (needs, uncertainty(needs, time, *noises)))


def baseline_of(cases: Iterable[Case], wanted: str = "") -> Case | None:
    """What ratios are of: the fastest that matches, else the usual, else the slowest known."""
    known = sorted((one for one in cases if one.settled), key=lambda one: one.time_s)
    matching = [one for one in known if wanted and re.search(wanted, one.case)]
    usual = [one for one in known if (one.tracker, one.majorant, one.tightness) == USUAL]
    return next(iter([*matching, *usual, *reversed(known)]), None)


def ratio(baseline: Case, one: Case) -> tuple[float, float, float]:
    """How many times as fast a case is as the baseline, with the 95 % interval of that."""
    middle, width = baseline.time_s / one.time_s, math.hypot(baseline.noise, one.noise)
    if one is baseline:
        return 1.0, 1.0, 1.0
    return middle, middle * math.exp(-width), middle * math.exp(width)


def digits(value: float) -> str:
    """A ratio with two digits or three."""
    if value >= 9.95:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:.1f}" if value >= 0.95 else f"{value:.2g}"


def times_as_fast(baseline: Case, one: Case) -> str:
    """The ratio in words."""
    middle, low, high = map(digits, ratio(baseline, one))
    return f"{middle} ({low} to {high}) times as fast"


def leading(cases: Iterable[Case], wanted: str = "") -> tuple[list[Case], Case] | None:
    """The fastest with those not significantly slower, and the baseline; None if none is known."""
    known = [one for one in cases if one.settled]
    if not known:
        return None
    places = soonest([(one.time_s, one.noise) for one in known])
    return [known[place] for place in places], baseline_of(known, wanted)


def sentence(
    cases: Sequence[Case], accuracy: float = 0.01, wanted: str = "", failed: int = 0
) -> str:
    """Who is the fastest to an accuracy, and how much faster than the baseline.

    `cases` are those that reach it; cases whose time is not settled are counted and not ranked,
    those that `failed` are counted.
    """
    known = [one for one in cases if one.settled]
    unranked = {"their variance is not settled": len(cases) - len(known), "they failed": failed}
    beside = [f"not ranked, as {why}: {count}" for why, count in unranked.items() if count]
    told = f"At {100 * accuracy:g} %: "
    found = leading(known, wanted)
    if not found:
        why = (
            "the variance of no case is settled; measure longer" if cases else "no case reaches it"
        )
        return told + "; ".join([why, *beside]) + "."
    (best, *close), baseline = found
    if best is baseline:
        told += f"{best.name} is the fastest"
    else:
        told += f"{best.name} is {times_as_fast(baseline, best)} as {baseline.name}"
    told += f", biased by {percent(best.bias)}" if best.biased else ""
    if close:
        told += f" (not significantly slower: {close[0].name}"
        told += f" and {len(close) - 1} more)" if len(close) > 1 else ")"
    others = [one for one in known if one.biased != best.biased]
    if others:
        other = min(others, key=lambda one: one.time_s)
        what = "fastest without measurable bias"
        what = f"biased by {percent(other.bias)}" if other.biased else what
        same = other is baseline
        told += f"; {what}: {other.name}"
        told += "" if same else f", {times_as_fast(baseline, other)}"
    elif best.biased:
        told += "; none without measurable bias reaches it"
    return "; ".join([told, *beside]) + "."


def percent(share: float) -> str:
    """A bias with one digit."""
    return f"{100 * share:.1g} %"
