"""From a measurement to its rows of summary.csv and samples.csv."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from freepath.cases.plan import Case
from freepath.compose.catalog import Tracker
from freepath.config.axes import AXES, label
from freepath.device import environment
from freepath.device.opencl import DeviceInfo
from freepath.measure.rounds import Measurement
from freepath.measure.stats import Accuracy, accuracy, relative_half_width
from freepath.results.columns import COLUMNS, TEXTS
from freepath.results.folder import SCHEMA_VERSION

ROUNDING = {"strict": 1e-3, "fast": 1e-3, "double": 1e-9}
"""Relative bias that an arithmetic may be excused for; far above what it costs."""
LADDER = {"time_to_10pct_s": 0.1, "time_to_1pct_s": 0.01, "time_to_0.1pct_s": 0.001}
"""Columns of the accuracy ladder, with the relative RMSE of each."""


def base_row(case: Case, device: DeviceInfo, run_id: str) -> dict[str, Any]:
    """What is known of a row before anything ran; all other columns are empty."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    for name, axis in AXES.items():
        value = axis.cell(case.point[name])
        row[axis.column or name] = str(value) if (axis.column or name) in TEXTS else value
    if case.lanes == "auto":
        row["lanes"] = device.lanes
    return row | {
        "schema_version": SCHEMA_VERSION,
        "run_id": run_id,
        "case_id": case.case_id,
        "case": case.name,
        "status": "skipped",
        "reason": case.skip_reason,
        "device": device.name,
        "platform": device.platform,
        "driver_version": device.driver_version,
        "host": environment.host(),
        "tracker": case.tracker,
        "tracker_label": label(case.point["tracker"]),
        "channels": case.medium.channel_count,
        "params": json.dumps(dict(case.params), sort_keys=True),
        "seed": case.seed,
        "source_sha256": "",
    }


def composed_for(case: Case, medium_kernel: str, along: Iterable[str] = ()) -> str:
    """What the kernel of a case was composed for; `along` are the effects along its paths."""
    parts = {
        "absorption": True,
        **dict.fromkeys(along if case.light else (), True),
        "heterogeneous": medium_kernel != "homogeneous",
        "majorant_grid": case.majorant and case.majorant.kind == "grid",
        "chromatic": case.medium.channel_count > 1,
    }
    return "+".join(name for name, there in parts.items() if there)


def measured_row(
    row: dict[str, Any],
    tracker: Tracker,
    found: Measurement,
    reference: np.ndarray | None,
    largest_score: float,
    claimed: np.ndarray | None = None,
) -> dict[str, Any]:
    """Fill in what was measured. A row whose numbers cannot be trusted says so in its status.

    `reference` is of the shape (rays,) or (rays, channels), None where it is unknown;
    `largest_score` bounds the scores of unbiased trackers. `claimed` is what these estimate where
    the medium was rounded to be stored: they are held to it, and the bias is against `reference`.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        result = accuracy(found.moments, reference)
        held = result if claimed is None else accuracy(found.moments, claimed)
    row = row | _costs(found, row["lanes"])
    row["status"], row["reason"] = verdict(tracker, row, held, largest_score)
    if row["status"] == "ok" and not found.tail.told:
        few = f"its variance is not known: {found.tail.units:.0f} units carry what is seen of it"
        row["reason"] = "; ".join(filter(None, [row["reason"], few]))
    if row["status"] != "invalid":
        row |= _errors(result, found, row)
    return row


def _costs(found: Measurement, lanes: int) -> dict[str, Any]:
    counted = found.counted
    per_sample = {name: counted.counters[name] / counted.samples for name in counted.counters}
    times = np.array(found.times)
    time_per_sample = float(np.median(times))
    iterations = sum(one.iterations for one in found.rounds)
    return {
        "samples_per_ray": found.moments.count,
        "rounds": len(found.rounds),
        "stopped": found.stopped,
        "lookups_per_sample": per_sample["lookups"],
        "crossings_per_sample": per_sample["crossings"],
        "steps_per_sample": per_sample["steps"],
        "lane_occupancy": found.total("steps") / (iterations * lanes),
        "time_per_sample_s": time_per_sample,
        "time_per_sample_cv": times.std(ddof=1) / times.mean() if len(times) > 1 else None,
        "time_noise": _finite(relative_half_width(found.times)),
        "timing_source": found.rounds[0].timing_source,
        "time_device_s": found.time_device_s,
        "time_wall_s": found.time_wall_s,
        "device_time_share": found.time_device_s / found.time_wall_s,
        "lookups_per_s": per_sample["lookups"] / time_per_sample,
        "truncated": found.total("truncated"),
        "nonfinite": found.total("nonfinite"),
        "violations": counted.counters["violations"],
        "counted_samples": counted.samples,
    }


def _errors(result: Accuracy, found: Measurement, row: dict[str, Any]) -> dict[str, Any]:
    seconds, told = row["time_per_sample_s"], found.tail.told
    return {
        "estimate": result.estimate,
        "reference": result.reference,
        "bias": result.bias,
        "bias_stderr": result.bias_stderr,
        "bias_rms": result.bias_rms,
        "z_score": result.z_score,
        "variance": result.variance,
        "variance_noise": _finite(relative_half_width(found.variances)) if told else None,
        "rmse": result.rmse,
        "inv_efficiency_lookups": result.variance * row["lookups_per_sample"],
        "inv_efficiency_s": result.variance * seconds,
        "figure_of_merit": _merit(result, seconds),
        **{name: result.time_to(error, seconds) for name, error in LADDER.items()},
    }


def _merit(result: Accuracy, seconds: float) -> float | None:
    mean = result.estimate if result.reference is None else result.reference
    return mean**2 / (result.variance * seconds) if result.variance > 0.0 else None


def verdict(
    tracker: Tracker, row: dict[str, Any], result: Accuracy, largest_score: float
) -> tuple[str, str]:
    """Status and reason of a measured row; the reason of an `ok` one is a remark, mostly none.

    Where a majorant was violated, an estimator is biased, or its scores have no bound and their
    spread is underestimated by any number of samples: that is told, and not held against it.
    """
    if row["nonfinite"]:
        return "invalid", f"{row['nonfinite']} scores are infinite or not a number"
    if not (math.isfinite(result.estimate) and math.isfinite(result.variance)):
        return "invalid", "the scores are too large for their variance to be a number"
    remarks = []
    if row["truncated"]:
        remarks.append(f"{row['truncated']} paths were cut off at the step cap")
    if row["violations"]:
        share = row["violations"] / (row["lookups_per_sample"] * row["counted_samples"])
        remarks.append(f"{100 * share:.3g} % of the lookups were above the majorant")
    claims = tracker.unbiased and not row["violations"]
    if claims and result.contradicted(largest_score, ROUNDING[row["arithmetic"]]):
        return "mismatch", "; ".join([_difference(result), *remarks])
    if result.unseen:
        remarks.append("all scores are 0: too few samples to tell their variance")
    return "ok", "; ".join(remarks)


def _difference(result: Accuracy) -> str:
    if result.z_score is None:
        return f"{result.bias:+.3g} from the float64 reference {result.reference:.6g}"
    return f"{result.z_score:+.1f} standard errors from the float64 reference"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def round_rows(row: dict[str, Any], found: Measurement) -> Iterator[dict[str, Any]]:
    """The rows of samples.csv: one a round, each with what it shares with its case's row."""
    first = 0
    for number, one in enumerate(found.rounds):
        yield row | {
            "round": number,
            "samples": one.samples,
            "first_sample_of_ray": first,
            "time_device_s": one.time_s,
            "time_wall_s": one.time_wall_s,
            "iterations": one.iterations,
            "estimate": _finite(one.estimate),
            "variance": None if one.variance is None else _finite(one.variance),
        }
        first += one.samples // row["rays"]
