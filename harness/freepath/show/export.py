"""Results in the formats of tools that keep and compare benchmarks: `freepath export`.

A case is a benchmark; its device follows its name where there are several. Times are device times,
wall times where the driver reports no others.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from freepath import __version__
from freepath.errors import FreepathError, NothingMatchedError
from freepath.results.folder import RUN, SUMMARY, Row
from freepath.results.reading import facts
from freepath.show import answers
from freepath.show.compare.pairing import run_of
from freepath.show.report.text import dicts
from freepath.show.table import FAILED, number

NS, MS = 1e9, 1e3
INVALIDITY = {
    "ok": "correct", "mismatch": "correctness", "invalid": "correctness",
    "build_failed": "compile", "timeout": "timeout",
}  # fmt: skip
"""Words of T4 for statuses; for all others it is `runtime`."""
CONFIGURATION = (
    "estimand", "medium", "rays", "tracker", "majorant", "tightness", "light", "scatterings",
    "p_absorb", "shadow", "effects", "arithmetic", "storage", "lanes",
)  # fmt: skip


@dataclass
class Item:
    """A case, with the seconds per sample of its rounds."""

    name: str
    row: Row
    times: list[float]

    def known(self) -> dict[str, tuple[float, float | None, str]]:
        """What was measured: value, half its 95 % interval and unit, by name.

        Times are in ns. The time to 1 % is there where it is known well enough to be ranked.
        """
        time, noise = number(self.row, "time_per_sample_s"), number(self.row, "time_noise")
        width = None if noise is None else NS * time * noise
        found = {"time-per-sample": (NS * time, width, "ns")}
        one = answers.case_of(self.row)
        if one and one.settled:
            found["time-to-1-percent"] = NS * one.time_s, NS * one.time_s * one.noise, "ns"
        plain = (("lookups-per-sample", "lookups_per_sample"), ("variance", "variance"))
        return found | {name: (number(self.row, column), None, "") for name, column in plain}


def _bmf(items: list[Item], told: dict[str, Any]) -> Any:
    """Bencher Metric Format: bencher.dev/docs/reference/bencher-metric-format."""
    found: dict[str, Any] = {}
    for item in items:
        of = found[item.name] = {}
        for name, (value, width, unit) in item.known().items():
            of[f"{name}-{unit}" if unit else name] = {"value": value} | (
                {"lower_value": value - width, "upper_value": value + width} if width else {}
            )
    return found


def _github(items: list[Item], told: dict[str, Any]) -> Any:
    """`customSmallerIsBetter` of github-action-benchmark."""
    return [
        {"name": f"{item.name}: {name}", "unit": unit, "value": value}
        | ({} if width is None else {"range": f"\u00b1 {width:.3g}"})
        | {"extra": f"{item.row['device']}, {len(item.times)} rounds"}
        for item in items
        for name, (value, width, unit) in item.known().items()
        if unit
    ]


def _google(items: list[Item], told: dict[str, Any]) -> Any:
    """JSON of Google Benchmark: a repetition per round; both of its times are the device time."""
    host = (dicts([told.get("host")]) or [{}])[0]
    context = {"date": told.get("started"), "executable": f"freepath {__version__}"}
    context |= {"num_cpus": host.get("cores"), "host_name": host.get("processor")}
    found: list[dict[str, Any]] = []
    for family, item in enumerate(items):
        base = {"name": item.name, "run_name": item.name, "family_index": family}
        base |= {"per_family_instance_index": 0, "run_type": "iteration", "threads": 1}
        if item.row["status"] in FAILED:
            reason = f"{item.row['status']}: {item.row['reason']}"
            found.append(base | {"error_occurred": True, "error_message": reason})
            continue
        rounds = {"repetitions": len(item.times), "time_unit": "ns"}
        rounds["iterations"] = int(item.row["samples_per_ray"] or 0) // max(1, len(item.times))
        counters = {name: value for name, (value, *_) in item.known().items()}
        for place, time in enumerate(item.times):
            times = {"repetition_index": place, "real_time": NS * time, "cpu_time": NS * time}
            found.append(base | rounds | times | counters)
    return {"context": context, "benchmarks": found}


def _t4(items: list[Item], told: dict[str, Any]) -> Any:
    """T4 1.0.0, the results of auto-tuning that Kernel Tuner reads; its times are in ms."""
    found = []
    for item in items:
        row, status = item.row, item.row["status"]
        try:
            params = dict(json.loads(row["params"] or "{}"))
        except ValueError as error:
            raise FreepathError(f"{item.name}: params: expected JSON: {error}") from error
        configuration = {name: row[name] for name in CONFIGURATION if row[name]} | params
        known = item.known() if status not in FAILED else {}
        found.append({
            "timestamp": str(told.get("started", "")),
            "configuration": configuration,
            "objectives": ["time-to-1-percent"],
            "times": {
                "compilation_time": MS * (number(row, "time_build_s") or 0.0),
                "runtimes": [MS * time for time in item.times],
            },
            "invalidity": INVALIDITY.get(status, "runtime"),
            "correctness": float(status == "ok"),
            "measurements": [
                {"name": name, "value": value, "unit": unit}
                for name, (value, _, unit) in known.items()
            ],
        })  # fmt: skip
    return {"schema_version": "1.0.0", "results": found}


def _pyperf(items: list[Item], told: dict[str, Any]) -> Any:
    """pyperf's JSON 1.0: a benchmark per case, whose values are seconds per sample of rounds."""

    def metadata(**texts: Any) -> dict[str, str]:  # which pyperf wants in a line, and not empty
        found = {name: " ".join(str(text or "").split()) for name, text in texts.items()}
        return {name: text for name, text in found.items() if text}

    return {
        "version": "1.0",
        "metadata": metadata(unit="second", date=told.get("started")),
        "benchmarks": [
            {
                "metadata": metadata(name=item.name, device=item.row["device"]),
                "runs": [{"values": item.times}],
            }
            for item in items
        ],
    }


FORMATS: dict[str, Callable[[list[Item], dict[str, Any]], Any]] = {
    "bmf": _bmf,
    "github-action-benchmark": _github,
    "google-benchmark": _google,
    "t4": _t4,
    "pyperf": _pyperf,
}
FAILURES = ("google-benchmark", "t4")
"""Formats that have a word for what went wrong."""


def exported(folder: Path, wanted: str, only: str = "") -> tuple[str, list[str]]:
    """A result in a format, as JSON, and what of it is left out, with the reason.

    Of cases whose name matches the expression `only`. Raises FreepathError where the folder is no
    result or nothing is left, NothingMatchedError where no case matches.
    """
    if not (folder / SUMMARY).is_file():
        raise FreepathError(f"{folder}: expected the folder of a run, with {SUMMARY} in it")
    run = run_of(folder)
    rows = {key: row for key, row in run.rows.items() if re.search(only, row["case"])}
    if not rows:
        raise NothingMatchedError(f"no case of {folder} matches '{only}'")
    several = len({row["device"] for row in rows.values()}) > 1
    items, left_out, unknown = [], [], 0
    for key, row in rows.items():
        name = f"{row['case']} [{row['device']}]" if several else row["case"]
        times = list(run.times.get(key, {}).values())
        if row["status"] in FAILED and wanted not in FAILURES:
            left_out.append(f"{name}: {row['status']}: {row['reason']}")
        elif row["status"] not in FAILED and not times:
            left_out.append(f"{name}: no rounds of it are in samples.csv")
        else:
            item = Item(name, row, times)
            items.append(item)
            unknown += row["status"] == "ok" and "time-to-1-percent" not in item.known()
    if not items:
        raise FreepathError("\n".join([f"{folder}: nothing can be exported:", *left_out]))
    if unknown and wanted != "pyperf":
        left_out.append(f"the time to 1 % of {unknown} cases: it is not known, or never reached")
    told = next(iter(dicts(facts(folder / RUN).get("sessions"))[-1:]), {})
    text = json.dumps(FORMATS[wanted](items, told), indent=1, allow_nan=False)
    return text + "\n", left_out
