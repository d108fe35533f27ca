"""The folder of a run: summary.csv (a row a case), samples.csv (a row a round), run.json."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from freepath.errors import FreepathError

SCHEMA_VERSION = 1
SUMMARY, SAMPLES, RUN = "summary.csv", "samples.csv", "run.json"
# fmt: off
COLUMNS = (
    "schema_version", "run_id", "case_id", "case", "status", "reason",
    "device", "platform", "driver_version",
    "tracker", "estimand", "medium", "majorant", "tightness", "effects", "arithmetic", "lanes",
    "params", "seed", "rays", "samples_per_ray", "rounds", "stopped",
    "lookups_per_sample", "crossings_per_sample", "steps_per_sample", "lane_occupancy",
    "time_per_sample_s", "time_per_sample_cv", "time_noise", "timing_source",
    "time_device_s", "time_wall_s", "device_time_share", "time_build_s", "lookups_per_s",
    "estimate", "reference", "bias", "bias_stderr", "bias_rms", "z_score", "variance", "rmse",
    "inv_efficiency_lookups", "inv_efficiency_s", "time_to_1pct_s",
    "truncated", "nonfinite", "violations", "counted_samples",
    "source_sha256", "config_sha256",
)
SAMPLE_COLUMNS = (
    "schema_version", "run_id", "case_id", "round", "samples", "first_sample_of_ray",
    "time_device_s", "time_wall_s", "iterations", "estimate", "variance",
)
# fmt: on
KEY = ("case_id", "config_sha256", "source_sha256", "device", "driver_version")
"""A row of an interrupted run stands if all of these are what they would be now."""
FINAL = ("ok", "skipped", "invalid", "mismatch")
"""Statuses that running again would only repeat."""


class ResultFolder:
    """Writes a run's files; every row is on the disk as soon as its case is done."""

    def __init__(self, folder: Path, *, resume: bool = False):
        self.folder = folder
        self.kept: list[dict[str, str]] = []
        summary = folder / SUMMARY
        if summary.exists() and not resume:
            raise FreepathError(
                f"{folder} already holds a run; continue it with --resume or name another folder"
            )
        if resume and not summary.exists():
            raise FreepathError(f"{folder} holds no run to resume (no {SUMMARY} there)")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if resume:
                self.kept = [row for row in read_rows(summary) if row["status"] in FINAL]
            else:
                self._rewrite(SUMMARY, COLUMNS, [])
                self._rewrite(SAMPLES, SAMPLE_COLUMNS, [])
        except OSError as error:
            raise FreepathError(f"cannot write to {folder}: {error.strerror}") from error

    def keep(self, keys: set[tuple[str, ...]]) -> set[tuple[str, ...]]:
        """Keep the rows of an earlier run whose key is wanted, drop all others; returns their keys."""
        self.kept = [row for row in self.kept if key_of(row) in keys]
        cases = {row["case_id"] for row in self.kept}
        samples = self.folder / SAMPLES
        old = read_rows(samples, SAMPLE_COLUMNS) if samples.exists() else []
        self._rewrite(SUMMARY, COLUMNS, self.kept)
        self._rewrite(SAMPLES, SAMPLE_COLUMNS, [row for row in old if row["case_id"] in cases])
        return {key_of(row) for row in self.kept}

    def _rewrite(self, name: str, columns: tuple[str, ...], rows: list[dict]) -> None:
        """Replace a file in one step, so that an interruption leaves the old or the new one."""
        temporary = self.folder / f"{name}.part"
        with temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, columns)
            writer.writeheader()
            writer.writerows(rows)
        os.replace(temporary, self.folder / name)

    def append(self, row: dict[str, Any], rounds: Iterable[dict[str, Any]] = ()) -> None:
        """Write a case's row and its rounds' rows, and flush them."""
        self._append(SAMPLES, SAMPLE_COLUMNS, rounds)
        self._append(SUMMARY, COLUMNS, [row])

    def _append(self, name: str, columns: tuple[str, ...], rows: Iterable[dict]) -> None:
        with (self.folder / name).open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, columns).writerows(
                {column: _text(row[column]) for column in columns} for row in rows
            )
            file.flush()
            os.fsync(file.fileno())

    def write_run(self, facts: dict[str, Any]) -> None:
        """Write run.json."""
        temporary = self.folder / f"{RUN}.part"
        temporary.write_text(json.dumps(facts, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        os.replace(temporary, self.folder / RUN)

    def rows(self) -> list[dict[str, str]]:
        """All rows so far, as they stand in the file."""
        return read_rows(self.folder / SUMMARY)

    def paths(self) -> list[Path]:
        """The files of the run."""
        return [self.folder / name for name in (SUMMARY, SAMPLES, RUN)]


def key_of(row: dict[str, str]) -> tuple[str, ...]:
    """What must agree for a row to stand for a case."""
    return tuple(row[column] for column in KEY)


def _text(value: Any) -> Any:
    """None is empty; floats in full; inf as the word that every reader of CSV knows."""
    if value is None:
        return ""
    if isinstance(value, float):
        if math.isnan(value):
            return ""
        return repr(value)
    return value


def read_rows(path: Path, columns: tuple[str, ...] = COLUMNS) -> list[dict[str, str]]:
    """Read a CSV of a run; a last row that was cut off by a crash is left out.

    Raises FreepathError where the file is not of this schema version.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            rows = [row for row in reader if None not in row.values() and None not in row]
    except (OSError, csv.Error, UnicodeDecodeError) as error:
        raise FreepathError(f"{path}: cannot be read: {error}") from error
    if tuple(reader.fieldnames or ()) != columns:
        raise FreepathError(f"{path}: its columns are not those of schema version {SCHEMA_VERSION}")
    return rows
