"""Majorants below the extinction and far above it; controls and null collisions of nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

from freepath.checks.cases import check_samples
from freepath.checks.identities import check_clean, check_mean
from freepath.checks.model import is_bounding
from freepath.checks.rig import Rig
from freepath.checks.suite.common import FEW, UPWARD, Checks, homogeneous, splits_off, voxels, walks
from freepath.checks.verdict import Failure, demand, hearing
from freepath.compose.catalog import Tracker
from freepath.measure.runner import STEP_CAP

TOO_LOW = (0.9, 0.5, 0.1)
SIGNED = ("ratio", "split", "two_knob", "weighted_delta")
CLAMPED = ("delta", "decomposition", "next_flight_delta")
"""Trackers that end as if the extinction were cut off at the majorant where that is lower."""
ANALOG = ("delta", "ratio", "split", "two_knob", "weighted_delta")
"""Trackers whose null collisions have no weight left where the majorant is met."""

MOST = 16
"""Of exp(-x), summed over points x of a Poisson process of rate 1: more comes once in 1e20."""


checks = Checks()


def _thin_voxels() -> np.ndarray:
    """An optical depth of about 0.2: so that weights stay known at a tenth of the majorant."""
    return 0.3 * np.random.default_rng(11).random((9, 5, 7)) + 0.05


def not_bounding(rig: Rig, alpha: float, tracker: Tracker, tightness: float) -> None:
    """A null coefficient that is negative, if clamped, biases silently: trackers that allow it stay
    unbiased by signed weights, all others report the violations and their bias."""
    # Unbiased and signed; or counted and off.
    flight = voxels(rig, tracker, _thin_voxels(), tightness=tightness)
    samples = flight.record(4096)
    found = samples.round
    demand(not found.counters["nonfinite"], "scores are no numbers")
    if is_bounding(tracker):
        violations = found.counters["violations"]
        demand(violations > 100, f"{violations} violations counted, expected many")
        return
    check_samples(flight, samples, alpha)
    if tracker.name in SIGNED:
        flown = np.minimum(samples.weight, samples.score)
        demand(flown.min() < 0.0, "no weight is negative where the null coefficient is")
        demand(found.counters["violations"] > 100, "violations are not counted")


@checks.hard("non-bounding/growth", lambda t: walks(t) and not is_bounding(t))
def growth(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """Weights grow where the majorant is too low: the variance that is reported must show it."""
    variance = [
        voxels(rig, tracker, _thin_voxels(), tightness=tightness).run(2048).variance or 0.0
        for tightness in (1.0, 0.1)
    ]
    text = f"variance {variance[0]:.3g} at tightness 1, {variance[1]:.3g} at 0.1, expected growth"
    demand(variance[1] > variance[0] * (1.0 - 1e-6), text)


@checks.hard("non-bounding/clamped-bias", lambda t: t.name in CLAMPED)
def clamped_bias(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A tracker that cannot do with a lower majorant sees the extinction cut off there: its bias is
    exactly that, or violations hide another defect."""
    # Half of the extinction where the majorant is half of it.
    axes: dict[str, Any] = {"tightness": 0.5, "rays": FEW}
    if splits_off(tracker):
        axes["parameters"] = {"control": "number", "share": 0}
    flight = homogeneous(rig, tracker, 2.0, **axes)
    moments = flight.run(8192).moments
    depth = flight.depth
    clamped = np.exp(-depth / 2.0)
    if moments.m2.any():
        check_mean(moments, clamped, alpha / 2)
    else:
        error = np.abs(moments.mean / clamped - 1.0).max()
        demand(error < 1e-5, f"off by {error:.3g} from what half the extinction lets through")
    try:
        # to be rejected: how unlikely it is says nothing of false alarms
        with hearing():
            check_mean(moments, flight.reference(), alpha / 2)
    except Failure:
        return
    raise Failure("no bias can be seen, expected that of half the extinction")


@checks.hard("loose/1e3", walks)
def loose(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A majorant a thousand times too high costs time, nothing else: a weight that is rounded the
    same way at each collision would drift."""
    flight = voxels(rig, tracker, _thin_voxels(), tightness=1000, rays=FEW)
    check_samples(flight, flight.record(512), alpha)


@checks.hard("loose/1e6", walks)
def very_loose(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """With a million collisions a path a step cap is near: paths that meet it must be counted, and
    all others right to a rounding for each collision."""
    # A million times too high: within a rounding for each collision, or cut off and counted.
    rays = {"orthographic": {"resolution": 2}}
    flight = homogeneous(rig, tracker, 0.7, tightness=1e6, rays=rays)
    # blocks of one sample: those of a block would follow each other in one lane
    samples = flight.record(1, blocks=8)
    found, expected = samples.round.counters, flight.reference()
    demand(not found["nonfinite"], "scores are no numbers")
    cut = found["truncated"]
    demand(found["steps"] >= cut * STEP_CAP, f"{cut} paths were cut off before the cap")
    if cut:
        return
    # a sum of the chances to get out from each collision: of those that tell there are few
    most = samples.score.max()
    demand(most <= MOST, f"a score of {most:.3g}, expected at most {MOST}")
    spread = samples.score.std() / np.sqrt(samples.score.size) + 1e-12
    error = abs(samples.score.mean() - expected.mean())
    # a score that is 0 or 1 may be the same 32 times
    spread = max(spread, 1.0 / samples.score.size) if spread < 1e-9 else spread
    allowed = stats.t.isf(alpha / 2, 31) * spread + samples.lookups.max() * flight.rounding
    demand(error <= allowed, f"off by {error:.3g}, expected at most {allowed:.3g}")


@checks.hard("loose/step-cap", lambda t: t.name in ("ratio", "split", "residual_ratio"))
def step_cap(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A path that would take a hundred million steps is cut off at the cap, and counted: dropped in
    silence, it biases what is left."""
    # All paths, each after as many steps as the cap allows.
    parameters = {"control": "number", "share": 0} if splits_off(tracker) else {}
    axes = {"tightness": 1e8, "rays": {"orthographic": {"resolution": 2}}}
    one = homogeneous(rig, tracker, 1.0, parameters=parameters, **axes).run(1, blocks=2)
    cut, steps = one.counters["truncated"], one.counters["steps"]
    demand(cut == one.samples, f"{cut} of {one.samples} paths counted as cut off")
    demand(steps == cut * STEP_CAP, f"{steps} steps, expected {cut * STEP_CAP}")
    demand(not one.counters["nonfinite"], "scores are no numbers")


@checks.hard("residual/null-of-zero", lambda t: t.name in ANALOG)
def null_of_zero(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """Where the majorant is the extinction, sigma_n is exactly 0: an approximate reciprocal makes
    it -1e-8, and so a negative weight."""
    # Extinctions whose reciprocals are not exact.
    for sigma in (1.0 / 3.0, 0.7, 1.1, 1.9):
        flight = homogeneous(rig, tracker, sigma, rays=UPWARD, tightness=1)
        samples = flight.record(2048)
        wrong = np.setdiff1d(np.unique(samples.score), [0.0, 1.0])
        demand(not wrong.size, f"a score of {wrong[:1]}, expected 0 or 1 and nothing else")
        check_samples(flight, samples, alpha / 4)


def controlled(rig: Rig, alpha: float, tracker: Tracker, share: float) -> None:
    """A control that leaves nothing over, or less than nothing: no division by a residual of 0, the
    right sign, or a violation that is counted."""
    parameters = {"control": "mean", "share": share}
    flight = homogeneous(rig, tracker, 1.5, rays=UPWARD, parameters=parameters)
    samples = flight.record(2048)
    if is_bounding(tracker) and share > 1.0:
        violations = samples.round.counters["violations"]
        known = abs(samples.round.estimate - flight.reference().mean()) < 1e-3
        demand(violations or not known, "a control above the extinction is not reported")
        return
    check_clean(samples.round, bounded=False)
    check_samples(flight, samples, alpha)


@checks.hard("residual/control-everywhere", lambda t: splits_off(t) and not is_bounding(t))
def control_by_cell(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A control from the mean of a cell is above the extinction in a part of it: residuals change
    sign within a cell."""
    parameters = {"control": "mean", "share": 1.2}
    flight = voxels(rig, tracker, 6.0 * _thin_voxels(), parameters=parameters)
    check_samples(flight, flight.record(1024), alpha)


for tightness in TOO_LOW:
    checks.hard(f"non-bounding/{tightness}", walks, tightness=tightness)(not_bounding)
for share, name in ((1.0, "control-is-extinction"), (1.3, "control-above")):
    checks.hard(f"residual/{name}", splits_off, share=share)(controlled)
