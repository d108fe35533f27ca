"""Counts are estimates too: each counter against an integral along the ray, in float64."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import special, stats

from freepath.checks.rig import Flight, Rig
from freepath.checks.suite.common import VOXELS, Checks, everyone, voxels
from freepath.checks.suite.expectations import AlongRays, Array, share
from freepath.checks.verdict import NotApplicable, demand, require
from freepath.compose.catalog import Tracker

COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.S)
UNCOUNTED = re.compile(r"\bsigma_t_at\s*\(|\bgather\s*\(\s*scene\b")
EXACT = frozenset(("closed_form", "cells"))
"""What gives optical depths without a lookup."""


ROUNDS, SAMPLES = 24, 128
"""Of which the counts vary as they do, and samples of each ray in each."""
CELLS = {"grid": {"resolution": [11, 7, 13]}}
"""That divide no voxels."""
LEAVES = {"octree": {"resolution": 8, "slack": 1.5}}
"""So loose that leaves differ from the finest cells, and from those of no slack."""
Counts = dict[str, Array]
"""Of each counter what a sample of each ray counts; `spare` is how many planes more it may cross,
where rounding puts the box's own plane just inside the end of the ray."""


checks = Checks()


@checks.each("lookups/counted", everyone, ("fast", "moments"))
def counted(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """What is read past the count of lookups makes a tracker look cheaper than it is: every one
    goes through sigma_t or sigma_t_at_tentative, which count."""
    for number, line in enumerate(COMMENT.sub(_blank, tracker.code).splitlines(), 1):
        found = UNCOUNTED.search(line)
        demand(
            not found,
            f"{tracker.path.name}:{number}: expected sigma_t or sigma_t_at_tentative, which count "
            f"lookups, got {found and found.group()}",
        )
    if tracker.needs & EXACT:
        raise NotApplicable("it takes optical depths from a formula or from cells")
    lookups = voxels(rig, tracker, VOXELS).record(256).round.counters["lookups"]
    demand(lookups > 0, "not one lookup counted in a medium that varies")


def _walking(along: AlongRays, ends: Array | float = 0.0, residual: Any = None) -> Counts:
    """Of tentative collisions with a step and a lookup each, on a path that a rate ends."""
    residual = along.sigma if residual is None else residual
    majorant, alive = along.majorant, along.alive(ends)
    left = along.alive(ends)[:, -1]
    tentative = along.integral(majorant * alive)
    beyond = residual > majorant + 1e-6 * (majorant + along.control)
    counts = {"lookups": tentative, "steps": tentative + left, "spare": left}
    counts |= {"crossings": along.crossed(ends)}
    return counts | {"violations": along.integral(majorant * alive * beyond)}


def _analog(along: AlongRays) -> Counts:
    return _walking(along, np.minimum(along.sigma, along.majorant))


def _signed(along: AlongRays) -> Counts:
    both = along.sigma + np.abs(along.majorant - along.sigma)
    return _walking(along, along.majorant * share(along.sigma, both))


def _controlled(along: AlongRays, *, weighted: bool) -> Counts:
    """A flight that a collision with the control ends takes a step and no lookup for it."""
    residual = along.sigma - along.control
    real = np.clip(share(residual, along.majorant), 0.0, 1.0)
    if weighted:
        real = share(np.abs(residual), np.abs(residual) + np.abs(along.majorant - residual))
    ends = along.control + along.majorant * real
    counts = _walking(along, ends, residual)
    if weighted:
        counts["violations"] = np.zeros(len(residual))
    counts["steps"] += along.integral(along.control * along.alive(ends))
    return counts


def _residual_ratio(along: AlongRays) -> Counts:
    return _walking(along) | {"violations": np.zeros(len(along.sigma))}


def _track_length(along: AlongRays) -> Counts:
    counts = _analog(along)
    return counts | {"lookups": counts["lookups"] + counts["steps"]}


def _with_depth(counts: Callable[[AlongRays], Counts]) -> Callable[[AlongRays], Counts]:
    """Beside the majorant's depth of the whole ray, by a walk through all of its cells."""

    def found(along: AlongRays) -> Counts:
        one, whole = counts(along), _walking(along)
        return one | {name: one[name] + whole[name] for name in ("crossings", "spare")}

    return found


def _series(along: AlongRays) -> Counts:
    """Terms up to the mass, then roulette; a point of each is looked for from the start."""
    whole, depth = _walking(along), along.integral(along.majorant)
    terms = np.arange(1, int(depth.max() + 12.0 * np.sqrt(depth.max()) + 40.0))
    before = stats.poisson.cdf(terms - 1, depth[:, None])
    mass = float(along.flight.case.params["mass"])
    goes_on = np.where(before >= mass, np.minimum(depth[:, None] / terms, 1.0), 1.0)
    lookups = np.cumprod(goes_on, axis=1).sum(axis=1)
    lookups[depth == 0.0] = 0.0
    # a plane is crossed on the way to a point that lies behind it in the majorant's depth
    behind = along.crossed(share(along.majorant, _ahead(along)))
    crossings = whole["crossings"] + (lookups + 1.0) * behind
    over = lookups * share(whole["violations"], depth)
    counts = {"lookups": lookups, "steps": lookups + 1.0, "crossings": crossings}
    return counts | {"violations": over, "spare": whole["spare"]}


def _ahead(along: AlongRays) -> Array:
    """The majorant's depth from each point on."""
    depth = along.majorant * along.step
    return np.cumsum(depth[:, ::-1], axis=1)[:, ::-1] - 0.5 * depth


def _marching(along: AlongRays) -> Counts:
    step = float(along.flight.case.params["step"])
    return _looking_up(np.ceil(along.flight.segments[:, 6] / step))


def _looking_up(lookups: Array) -> Counts:
    """A lookup a step, and no walk."""
    nothing = np.zeros(len(lookups))
    counts = {"lookups": lookups, "steps": lookups, "crossings": nothing}
    return counts | {"violations": nothing, "spare": nothing}


def _telescoping(along: AlongRays) -> Counts:
    """The level j has the chance (1 - r) r^j and 2^(j + 1) times as many steps."""
    steps, ratio = (float(along.flight.case.params[name]) for name in ("steps", "ratio"))
    mean = steps * (1.0 + 2.0 * (1.0 - ratio) / (1.0 - 2.0 * ratio))
    return _looking_up(np.full(len(along.sigma), mean))


def _unbiased_march(along: AlongRays) -> Counts:
    """Combs, one more than the order, whose chance to be k or more is 0.9 x 2^(k - 1) / k!."""
    depth, whole = along.integral(along.majorant), _walking(along)
    teeth = np.ceil(np.cbrt((0.015 + depth) * (0.65 + depth) * (60.3 + depth)))
    orders = np.arange(1, 16)
    combs = 1.0 + 0.9 * (2.0 ** (orders - 1.0) / special.factorial(orders)).sum()
    return _looking_up(teeth * combs) | {name: whole[name] for name in ("crossings", "spare")}


KNOWN: dict[str, Callable[[AlongRays], Counts]] = {
    **dict.fromkeys(("ratio", "split", "spectral_ratio"), _walking),
    **dict.fromkeys(("weighted_delta", "two_knob", "spectral"), _signed),
    "delta": _analog,
    "decomposition": lambda along: _controlled(along, weighted=False),
    "weighted_decomposition": lambda along: _controlled(along, weighted=True),
    "residual_ratio": _residual_ratio,
    "track_length": _track_length,
    "next_flight_delta": _with_depth(_analog),
    "next_flight_ratio": _with_depth(_walking),
    "p_series_cmf": _series,
    "telescoping_march": _telescoping,
    "unbiased_march": _unbiased_march,
    "march": _marching,
}  # fmt: skip


IN_LEAVES = ("ratio", "weighted_decomposition")


@checks.each("lookups/as-derived", lambda tracker: tracker.name in KNOWN, ("fast", "moments"))
def derived(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A crossing, a step or a violation that is counted twice or never hides what a walk costs and
    where a majorant fails: each counter has an integral."""
    # Lookups, steps, crossings and violations, above and below a bounding majorant.
    majorants: tuple[Any, Any] = ("global", "global")
    if "majorant" in tracker.needs and "octree" in tracker.majorants:
        majorants = CELLS, LEAVES if tracker.name in IN_LEAVES else CELLS
    for majorant, tightness in zip(majorants, (1.25, 0.8), strict=True):
        axes = {"tightness": tightness, "majorant": majorant, "rays": {"chords": {"count": 64}}}
        flight = voxels(rig, tracker, VOXELS, **axes)
        check_counters(flight, KNOWN[tracker.name](AlongRays(flight)), alpha / 2)


def check_counters(flight: Flight, expected: Counts, alpha: float) -> None:
    """t-tests of what rounds count; of what does not vary, equality but for a part in 1000."""
    rounds = [flight.run(SAMPLES, first_sample=i * SAMPLES).counters for i in range(ROUNDS)]
    names = [name for name in expected if name != "spare"]
    wanted = SAMPLES * np.array([expected[name].sum() for name in names])
    found = np.array([[one[name] for name in names] for one in rounds], float)
    spare = SAMPLES * expected["spare"].sum() * np.array([name == "crossings" for name in names])
    mean, error = found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(ROUNDS)
    off = np.maximum(wanted - mean, np.maximum(mean - wanted - spare, 0.0))
    for name, count, right, wrong in zip(names, mean, wanted, off - 1e-3 * wanted, strict=True):
        still = found[:, names.index(name)].std() == 0.0
        demand(not still or wrong <= 0.0, f"{name}: {count:.6g} a round, expected {right:.6g}")
    varies = error > 0.0
    p_values = 2.0 * stats.t.sf(off[varies] / error[varies], ROUNDS - 1)
    if varies.any():
        which = ", ".join(np.array(names)[varies])
        require(p_values, alpha, which, mean[varies], wanted[varies])


def _blank(comment: re.Match[str]) -> str:
    """As many lines without words, so that numbers of lines stay."""
    return "\n" * comment.group().count("\n")
