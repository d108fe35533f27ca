"""From a measurement to its rows of summary.csv and samples.csv."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from freepath.catalog import Tracker
from freepath.device import DeviceInfo
from freepath.measure import Measurement
from freepath.plan import Case, label
from freepath.results import COLUMNS, SCHEMA_VERSION
from freepath.stats import Accuracy, accuracy, relative_half_width

MISMATCH_Z = 6.0
"""Beyond this an estimator that claims to be unbiased is wrong: by chance once in 5e8 rows."""
MISMATCH_ROUNDING = 1e-3
"""The same for estimators without variance, relative: far above what float32 may cost."""


def base_row(case: Case, device: DeviceInfo, run_id: str) -> dict[str, Any]:
    """What is known of a row before anything ran; all other columns are empty."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row |= {
        "schema_version": SCHEMA_VERSION,
        "run_id": run_id,
        "case_id": case.case_id,
        "case": case.name,
        "status": "skipped",
        "reason": case.skip_reason,
        "device": device.name,
        "platform": device.platform,
        "driver_version": device.driver_version,
        "tracker": case.tracker,
        "estimand": case.estimand,
        "medium": label(case.medium),
        "majorant": label(case.majorant) if case.majorant else "none",
        "tightness": case.tightness,
        "arithmetic": case.arithmetic,
        "lanes": case.lanes,
        "params": json.dumps(dict(case.params), sort_keys=True),
        "seed": case.seed,
    }
    return row


def effects_of(case: Case, medium_kernel: str) -> str:
    """What the kernel of a case was composed for."""
    effects = ["absorption"]
    if medium_kernel != "homogeneous":
        effects.append("heterogeneous")
    if case.majorant and case.majorant.kind == "grid":
        effects.append("majorant_grid")
    return "+".join(effects)


def measured_row(
    row: dict[str, Any], tracker: Tracker, found: Measurement, reference: np.ndarray, lanes: int
) -> dict[str, Any]:
    """Fill in what was measured. A row whose numbers cannot be trusted says so in its status."""
    rays, samples = len(reference), found.moments.count
    result = accuracy(found.moments, reference)
    row = row | _costs(found, lanes) | {"rays": rays, "samples_per_ray": samples}
    row |= {"truncated": found.total("truncated"), "nonfinite": found.total("nonfinite")}
    row["violations"] = found.counted.counters["violations"]
    row["status"], row["reason"] = verdict(tracker, row, result)
    if row["status"] != "invalid":
        row |= _errors(result, row)
    return row


def _costs(found: Measurement, lanes: int) -> dict[str, Any]:
    counted = found.counted
    per_sample = {name: counted.counters[name] / counted.samples for name in counted.counters}
    times = np.array(found.times)
    time_per_sample = float(np.median(times))
    iterations = sum(one.iterations for one in found.rounds)
    spread = float(times.std(ddof=1) / times.mean()) if len(times) > 1 else None
    return {
        "rounds": len(found.rounds),
        "stopped": found.stopped,
        "lanes": lanes,
        "lookups_per_sample": per_sample["lookups"],
        "crossings_per_sample": per_sample["crossings"],
        "steps_per_sample": per_sample["steps"],
        "lane_occupancy": found.total("steps") / (iterations * lanes),
        "time_per_sample_s": time_per_sample,
        "time_per_sample_cv": spread,
        "time_noise": _finite(relative_half_width(found.times)),
        "timing_source": found.rounds[0].timing_source,
        "time_device_s": found.time_device_s,
        "time_wall_s": found.time_wall_s,
        "device_time_share": found.time_device_s / found.time_wall_s,
        "lookups_per_s": per_sample["lookups"] / time_per_sample,
        "counted_samples": counted.samples,
    }


def _errors(result: Accuracy, row: dict[str, Any]) -> dict[str, Any]:
    seconds = row["time_per_sample_s"]
    return {
        "estimate": result.estimate,
        "reference": result.reference,
        "bias": result.bias,
        "bias_stderr": result.bias_stderr,
        "bias_rms": result.bias_rms,
        "z_score": result.z_score,
        "variance": result.variance,
        "rmse": result.rmse,
        "inv_efficiency_lookups": result.variance * row["lookups_per_sample"],
        "inv_efficiency_s": result.variance * seconds,
        "time_to_1pct_s": result.time_to(0.01, seconds),
    }


def verdict(tracker: Tracker, row: dict[str, Any], result: Accuracy) -> tuple[str, str]:
    """Status and reason of a measured row."""
    if row["nonfinite"] or not math.isfinite(result.estimate):
        return "invalid", f"{row['nonfinite']} scores are infinite or not a number"
    bound = tracker.needs_bound(json.loads(row["params"]))
    claims = tracker.unbiased and not row["truncated"] and not (bound and row["violations"])
    if not claims:
        return "ok", ""
    if result.z_score is not None and abs(result.z_score) > MISMATCH_Z:
        return "mismatch", f"{result.z_score:+.1f} standard errors from the float64 reference"
    if result.z_score is None and abs(result.bias) > MISMATCH_ROUNDING * abs(result.reference):
        return "mismatch", f"{result.bias:+.3g} from the float64 reference {result.reference:.6g}"
    return "ok", ""


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def round_rows(row: dict[str, Any], found: Measurement) -> Iterator[dict[str, Any]]:
    """The rows of samples.csv: one a round."""
    first = 0
    for number, one in enumerate(found.rounds):
        yield {
            "schema_version": row["schema_version"],
            "run_id": row["run_id"],
            "case_id": row["case_id"],
            "round": number,
            "samples": one.samples,
            "first_sample_of_ray": first,
            "time_device_s": one.time_s,
            "time_wall_s": one.time_wall_s,
            "iterations": one.iterations,
            "estimate": one.estimate,
            "variance": one.variance,
        }
        first += one.samples // row["rays"]
