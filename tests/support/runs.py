"""Runs of a model, to be compared, and their folders."""

import csv
import json

import numpy as np

from freepath.results.folder import COLUMNS, SAMPLE_COLUMNS
from freepath.show.compare.pairing import Run

ROUNDS = 100


def row_of(name, **changes):
    row = dict.fromkeys(COLUMNS, "") | {
        "schema_version": "6",
        "run_id": "r",
        "case_id": name,
        "case": f"transmittance/m/{name}/auto/strict",
        "status": "ok",
        "device": "d",
        "platform": "p",
        "driver_version": "1",
        "medium": "m",
        "rays": "64",
        "seed": "1",
        "lanes": "16",
        "arithmetic": "strict",
        "samples_per_ray": "100",
        "counted_samples": "6400",
        "lookups_per_sample": "3.5",
        "timing_source": "device",
        "estimate": "0.5",
        "reference": "0.5",
        "bias_stderr": "0.0005",
        "variance": "0.25",
        "time_per_sample_s": "1e-06",
        "lane_occupancy": "0.9",
        "majorant": "none",
    }
    return row | changes


def modelled(random, cases=8, rounds=ROUNDS, noise=0.01):
    """A run: a level of its own, a drift that lasts, and noise with rare high values."""
    drift = 0.1 * random.normal() + np.cumsum(0.02 * random.normal(size=rounds))
    run = Run({}, {}, {}, {})
    for i in range(cases):
        key = (f"c{i}", "d", "p")
        run.rows[key] = row_of(f"c{i}")
        rare = 0.2 * random.exponential(size=rounds) * (random.random(rounds) < 0.05)
        times = 1e-6 * (1 + i) * np.exp(drift + noise * random.normal(size=rounds) + rare)
        run.times[key] = dict(enumerate(times.tolist()))
        run.variances[key] = (0.25 + 0.01 * random.normal(size=rounds)).tolist()
    return run


def write(folder, run, *, names=None, processor="x"):
    folder.mkdir(parents=True)
    names = names or list(run.rows)
    with (folder / "summary.csv").open("w") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(run.rows[name] for name in names)
    with (folder / "samples.csv").open("w") as file:
        writer = csv.DictWriter(file, SAMPLE_COLUMNS)
        writer.writeheader()
        for key in names:
            for number, seconds in run.times[key].items():
                values = {"case_id": key[0], "device": "d", "platform": "p", "round": number}
                values |= {"samples": 1000, "time_device_s": 1000 * seconds, "variance": 0.25}
                values["time_wall_s"] = values["time_device_s"]
                writer.writerow(dict.fromkeys(SAMPLE_COLUMNS, "") | values)
    host = {"processor": processor, "cores": 2, "system": "s"}
    (folder / "run.json").write_text(json.dumps({"sessions": [{"host": host}]}))
    return folder
