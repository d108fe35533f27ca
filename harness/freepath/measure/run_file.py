"""run.json: what a run was made of, and how each of its sessions went."""

from __future__ import annotations

import dataclasses
import datetime
import os
from typing import Any

from freepath.compose.source import BUILD_OPTIONS, combined_hash
from freepath.config import Config
from freepath.device import environment
from freepath.device.opencl import Device
from freepath.measure.jobs import Job
from freepath.results.folder import SCHEMA_VERSION, ResultFolder

HASHES = ("case_id", "case", "device", "config_sha256", "source_sha256")
Facts = dict[str, Any]


def facts_of(config: Config, devices: list[Device], jobs: list[Job]) -> Facts:
    """What is so for the whole run."""
    return {
        "schema_version": SCHEMA_VERSION,
        "config_file": str(config.path),
        "config": config.as_dict(),
        "config_text": config.text,
        "config_sha256": combined_hash(config.text),
        "seed": config.seed,
        "devices": [dataclasses.asdict(device.info) for device in devices],
        "build_options": {name: list(options) for name, options in BUILD_OPTIONS.items()},
        "cases": [{name: job.row[name] for name in HASHES} for job in jobs],
    }


def session_of(run_id: str, devices: list[Device], cases_to_run: int) -> Facts:
    """What is so until the run ends or is interrupted, and may be otherwise when it goes on."""
    return {
        "run_id": run_id,
        "started": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "process": os.getpid(),
        "devices": [device.info.label for device in devices],
        "cases_to_run": cases_to_run,
        "host": environment.describe(),
    }


def write(folder: ResultFolder, facts: Facts, session: Facts) -> None:
    """Write both, beside earlier sessions and what is known of other devices."""
    before = folder.read_run()
    others = [one for one in _dicts(before, "sessions") if one.get("run_id") != session["run_id"]]
    labels = {device["name"] for device in facts["devices"]}
    merged = {
        name: [one for one in _dicts(before, name) if one.get(key) not in labels] + facts[name]
        for name, key in (("devices", "name"), ("cases", "device"))
    }
    folder.write_run(facts | merged | {"sessions": [*others, session]})


def _dicts(facts: Facts, name: str) -> list[Facts]:
    found = facts.get(name)
    return [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []
