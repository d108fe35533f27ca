"""Rows of summary.csv that nobody measured, and the folder of a result that holds them."""

import csv
import json

from freepath.results.folder import COLUMNS, CONFIRM_COLUMNS

EVIL = "</script><script>alert(1)</script><b>`|"
ROW = dict.fromkeys(COLUMNS, "") | {
    "case_id": "1",
    "case": "transmittance/cloud-64/global/t1/delta/auto/strict",
    "status": "ok",
    "device": "a [b] <c>",
    "platform": "p",
    "driver_version": "1",
    "estimand": "transmittance",
    "medium": "cloud-64",
    "majorant": "global",
    "tightness": "1.0",
    "tracker": "delta",
    "tracker_label": "delta",
    "arithmetic": "strict",
    "lanes": "16",
    "rays": "64",
    "time_per_sample_s": "1e-06",
    "lookups_per_sample": "5.0",
    "lane_occupancy": "0.9",
    "time_noise": "0.02",
    "variance_noise": "0.02",
    "estimate": "0.5",
    "reference": "0.5",
    "variance": "0.25",
    "bias": "0.0",
    "bias_stderr": "0.001",
    "bias_rms": "0.0",
    "time_to_10pct_s": "0.0001",
    "time_to_1pct_s": "0.01",
    "time_to_0.1pct_s": "inf",
}


def row_of(number, tracker, tightness=1.0, seconds=1e-6, **changes):
    case = f"transmittance/cloud-64/global/t{tightness:g}/{tracker}/auto/strict"
    row = ROW | {"case_id": str(number), "case": case, "tracker": tracker, "tracker_label": tracker}
    row |= {"tightness": str(tightness), "time_per_sample_s": str(seconds)}
    return row | {"time_to_1pct_s": str(1e4 * seconds)} | changes


def result_of(folder, rows, confirmed=()):
    folder.mkdir(exist_ok=True)
    for name, columns, found in (
        ("summary.csv", COLUMNS, rows),
        ("confirm.csv", CONFIRM_COLUMNS, confirmed),
    ):
        if found:
            with (folder / name).open("w", newline="") as file:
                writer = csv.DictWriter(file, columns)
                writer.writeheader()
                writer.writerows(found)
    host = {"processor": EVIL, "load_at_start": 1.5}
    (folder / "run.json").write_text(json.dumps({"sessions": [{"host": host}]}))
    return folder
