"""Optical depths from 1e-12 to a million."""

from __future__ import annotations

import numpy as np
from scipy import stats

from freepath.checks.cases import check_samples
from freepath.checks.identities import check_clean
from freepath.checks.model import needs_double
from freepath.checks.rig import Rig
from freepath.checks.suite.common import (
    UPWARD,
    VOXELS,
    Checks,
    everyone,
    has_free_path,
    homogeneous,
    splits_off,
    voxels,
)
from freepath.checks.suite.identity import SCORES_ON_ITS_WAY
from freepath.checks.verdict import demand
from freepath.compose.catalog import Tracker
from freepath.measure.runner import STEP_CAP

ONLY_WEIGHS = (
    "analytic", "march", "next_flight_ratio", "ratio", "regular", "residual_ratio", "split",
)  # fmt: skip
"""Trackers that leave no rare event to a uniform number, which is a multiple of 2^-24."""
WITHIN_1 = ("analytic", "decomposition", "delta", "march", "ratio", "regular", "split")
"""Trackers whose weights are products of probabilities where the majorant bounds."""
TO_THE_END = (*SCORES_ON_ITS_WAY, "resampled")
"""Trackers whose flights go to the end of the ray, whatever they score."""
THICK = {"tau-50": 50.0, "tau-1e3": 1e3, "tau-1e6": 1e6}
THIN = {"tau-1e-7": 1e-7, "tau-1e-12": 1e-12}


checks = Checks()


def thin(rig: Rig, alpha: float, tracker: Tracker, depth: float) -> None:
    """Where next to nothing is taken, an epsilon that clamps a logarithm or a density takes far
    more: what is taken must be right to the grain of uniform numbers and floats."""
    # To the grain of the numbers: 2^-24 for each draw or rounding.
    flight = homogeneous(rig, tracker, depth, rays=UPWARD, estimand=tracker.estimands[0])
    samples = flight.record(4096)
    check_clean(samples.round, bounded=True)
    moments = samples.round.moments
    taken, expected = (1.0 - moments.mean).mean(), (1.0 - flight.reference()).mean()
    error = np.sqrt((moments.variance / moments.count).sum()) / len(moments.mean)
    grain = (2.0 + samples.lookups.mean()) * 2.0**-24
    allowed = stats.norm.isf(alpha / 2) * error + grain
    text = f"takes {taken:.4g}, expected {expected:.4g} +- {allowed:.2g}"
    demand(abs(taken - expected) <= allowed, text)


def relative(rig: Rig, alpha: float, tracker: Tracker, depth: float) -> None:
    """T of a thin medium is right whatever one computes; the relative error of 1 - T is not, if
    weights are made of products of rounded reciprocals."""
    # In double precision, with majorants so loose that there is a collision to weigh.
    axes = {"arithmetic": "double", "lanes": 4, "rays": UPWARD, "tightness": 1.0 / depth}
    flight = homogeneous(rig, tracker, depth, **axes)
    moments = flight.record(4096).round.moments
    expected = -np.expm1(-flight.depth).mean()
    taken = (1.0 - moments.mean).mean()
    error = np.sqrt((moments.variance / moments.count).sum()) / len(moments.mean)
    # a rounding of T for each collision is the least that can be had
    allowed = stats.norm.isf(alpha / 2) * error + 16 * flight.rounding
    demand(allowed < 0.1 * expected, f"1 - T is known to {allowed / expected:.2g} only")
    text = f"takes {taken:.6g}, expected {expected:.6g} +- {allowed:.2g}"
    demand(abs(taken - expected) <= allowed, text)


@checks.hard("thin/huge-extent", everyone)
def huge(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """An atmosphere of tiny density and huge extent is lost to any absolute cut-off of densities or
    distances."""
    # 1e-12 a length unit, over 1e12 of them.
    flight = voxels(rig, tracker, VOXELS, 1e12, seed=rig.seed + 3)
    check_samples(flight, flight.record(512), alpha)


def thick(rig: Rig, alpha: float, tracker: Tracker, depth: float) -> None:
    """T underflows, and a product of transmittances over densities is 0 / 0 beyond 87 mean free
    paths: it must become 0, weights must stay in [0, 1], and cost bounded."""
    # Nothing comes through, and nothing becomes infinite or no number.
    rays = UPWARD if depth < 1e5 else {"orthographic": {"resolution": 1}}
    # blocks of one sample: those of a block would follow each other in one lane
    flight = homogeneous(rig, tracker, depth, rays=rays)
    one = flight.record(1, blocks=16)
    if one.score.std() > 1e-6:
        # of a distribution with a long tail, whose paths are short: sixteen do not tell its error
        one = flight.record(1, blocks=4096)
    found = one.round.counters
    demand(not found["nonfinite"], f"{found['nonfinite']} scores are no numbers")
    demand(not found["violations"], f"{found['violations']} violations of a majorant that bounds")
    # what is cut off is told; only a path of so many steps may be
    cut = found["truncated"]
    demand(found["steps"] >= cut * STEP_CAP, f"{cut} paths were cut off before the cap")
    # all but 0, or 0 on average, of trackers that subtract what is lost from 1
    error = np.sqrt(one.score.var() / one.score.size)
    text = f"mean {one.round.estimate:.3g} +- {error:.2g}, expected 0"
    demand(abs(one.round.estimate) < stats.norm.isf(alpha / 2) * error + 1e-6, text)
    if tracker.name in WITHIN_1:
        demand(one.weight.min() >= 0.0 and one.weight.max() <= 1.0, "a weight beyond [0, 1]")
    if splits_off(tracker) or not cut:
        lookups = one.lookups.max()
        demand(lookups <= 8.0 * depth + 1e5, f"{lookups:.3g} lookups for a path")


@checks.hard("thick/free-path", lambda t: has_free_path(t) and t.name not in TO_THE_END)
def short_paths(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """Free paths of a millionth of the ray are lost if distances are summed over what is left."""
    # The distribution of free paths in an optical depth of a million.
    axes = {"estimand": "free_path", "rays": UPWARD}
    if not tracker.unbiased:
        axes["parameters"] = {"step": 1e-4}
    flight = homogeneous(rig, tracker, 1e6, **axes)
    samples = flight.record(1024)
    check_samples(flight, samples, alpha)
    demand(not samples.escaped.any(), "a path through an optical depth of a million")


for name, depth in THIN.items():
    checks.hard(f"thin/{name}", everyone, depth=depth)(thin)
    checks.hard(
        f"thin/relative-{name}",
        lambda t: t.name in ONLY_WEIGHS and t.name != "next_flight_ratio",
        depth=depth,
        applies=needs_double,
        speed="slow",
    )(relative)
for name, depth in THICK.items():
    checks.hard(f"thick/{name}", lambda t: t.estimands[0] == "transmittance", depth=depth)(thick)
