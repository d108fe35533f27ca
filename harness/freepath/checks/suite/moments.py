"""Variances and costs agree with what is known of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from freepath.checks.identities import check_count, check_mean, check_variance
from freepath.checks.media import MAJORANTS, MEDIA
from freepath.checks.model import FURTHER, Check
from freepath.checks.rig import Flight, Rig
from freepath.checks.suite import expectations as known
from freepath.checks.verdict import demand
from freepath.compose.catalog import Catalog

SAMPLES = 4096
TIGHTNESS = (1.5, 2.0, 1.25, 4.0)
THICKEST = 2.0
"""The optical depth beyond which weights have so heavy a tail that the variance of a sample says
little about the variance."""
EXACT = {"delta": known.binary, "ratio": known.ratio}
RELATIVES: dict[str, tuple[dict[str, Any], float, Callable[..., known.Expected]]] = {
    "weighted_delta": ({}, 1.5, known.free(1.0)),
    "weighted_delta-not-bounded": ({}, 0.8, known.free(1.0)),
    "weighted_delta-analog": ({"probability": "analog"}, 1.5, known.binary),
    "weighted_delta-no_absorption": (
        {"probability": "no_absorption"}, 1.5, known.free(1.0, albedo=0.8)
    ),
    "two_knob-0.3": ({"acceptance": 0.3}, 1.5, known.free(0.3)),
    "two_knob-3": ({"acceptance": 3}, 1.5, known.free(3.0)),
    "split": ({}, 1.5, known.ratio),
    "residual_ratio": ({}, 1.5, known.residual_ratio),
    "residual_ratio-1.2": ({"control": "minorant", "share": 1.2}, 1.5, known.residual_ratio),
    "decomposition": ({}, 1.5, known.binary),
    "weighted_decomposition": ({"share": 0.3}, 1.5, known.weighted_decomposition),
    "next_flight_delta": ({}, 1.5, known.cost_of(known.binary)),
    "next_flight_ratio": ({}, 1.5, known.cost_of(known.ratio)),
    "track_length": ({}, 1.5, known.track_length_cost),
    "jackknife": ({}, 1, known.jackknife),
    "jackknife_placed": ({}, 1, known.jackknife_placed),
    "jackknife_placed-mean": ({"placement": "mean"}, 1, known.jackknife_placed),
    "resampled": ({"scatter": 0.3}, 1.5, known.resampled),
    "collision": ({}, 1.5, known.collision),
    "decomposition_factored": ({}, 1.5, known.factored),
    "hybrid": ({"threshold": 0.3}, 1.5, known.hybrid),
    "biased_march": ({}, 1.5, known.biased_march),
    "biased_march-free": ({"ends": "free"}, 1.5, known.biased_march),
    "production_march": ({"step": 0.1, "stop": 0.1}, 1, known.production_march),
}  # fmt: skip
BY_CELLS = ("jackknife_placed", "production_march")
IN_LAYERS = ("hybrid", "production_march")
"""Of cells of constant extinction, of which one is empty, and so are some of the majorant."""


def checks(catalog: Catalog) -> Iterator[Check]:
    """Of delta and ratio tracking in every medium, of their relatives in two."""
    for tracker, known_of in EXACT.items():
        for m, medium in enumerate(MEDIA):
            for j, majorant in enumerate(MAJORANTS):
                axes = {"tracker": tracker, "medium": medium, "majorant": majorant}
                axes |= {"tightness": TIGHTNESS[(m + 2 * j) % 4], "lanes": (16, 1)[(m + j) % 2]}
                expected = partial(_relative, known_of)
                yield _check(f"{tracker}/{medium}/{majorant}", tracker, axes, expected)
    for name, (parameters, tightness, known_of) in RELATIVES.items():
        tracker = name.partition("-")[0]
        majorant = "grid" if tracker in BY_CELLS else "global"
        cells = {"grid": {"resolution": [5, 3, 15]}} if majorant == "grid" else majorant
        for medium in ("layered",) if tracker in IN_LAYERS else ("exponential", "trilinear"):
            axes = {"tracker": {tracker: parameters}, "medium": medium, "tightness": tightness}
            axes |= {"lanes": 16, "majorant": cells}
            expected = partial(_relative, known_of)
            yield _check(f"{name}/{medium}/{majorant}", tracker, axes, expected)


def _check(name: str, tracker: str, axes: dict[str, Any], expected: Any) -> Check:
    speed = "fast" if tracker in (EXACT if "/trilinear/" in name else FURTHER) else "slow"
    kernels = f"{tracker}/transmittance/{name.partition('/')[2]}"
    options = {"kernels": kernels, "axes": axes, "expected": expected}
    return Check.of(f"moments/{name}", (speed, "moments", tracker), as_derived, **options)


def _relative(known_of: Callable[..., known.Expected], flight: Flight) -> known.Expected:
    along = known.AlongRays(flight)
    second, lookups, *mean = known_of(along)
    square = np.square(mean[0] if mean else along.transmittance)
    return None if second is None else second - square, lookups, *mean


def as_derived(
    rig: Rig, alpha: float, axes: dict[str, Any], expected: Callable[[Flight], known.Expected]
) -> None:
    """An estimator may be right on average and play where it should weigh, or look up twice: its
    variance and its lookups must be those that are derived for it."""
    flight = rig.flight(**axes)
    variance, lookups, *mean = expected(flight)
    samples = flight.record(SAMPLES)
    check_mean(samples.round.moments, mean[0] if mean else flight.reference(), alpha / 3)
    check_count(samples.lookups, lookups, alpha / 3)
    thin = flight.depth <= THICKEST
    demand(np.count_nonzero(thin) > 100, "too few rays are thin enough")
    if variance is not None:
        check_variance(samples.score[thin], variance[thin], alpha / 3)
    total = samples.lookups.sum()
    counted = samples.round.counters["lookups"]
    demand(total == counted, f"{counted} lookups in all, {total:.0f} in single samples")
