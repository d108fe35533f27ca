"""What tests/device/test_devices_all.py runs in the process of each driver: `python -m
support.flights`.

Every case's samples go to one file, so that drivers can be held against each other; what failed is
kept as the message that a user would get.
"""

from __future__ import annotations

import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np

from freepath.checks.rig import Rig
from freepath.checks.suite.identity import WALKS, Axes, cases_of, name_of
from freepath.compose import catalog
from freepath.compose.source import Source
from freepath.device import opencl as device
from freepath.device.opencl import Device
from freepath.errors import FreepathError

RAYS, SAMPLES = 12, 4
DEFECTS = {
    "a read beyond the end": "out[get_global_id(0)] = out[1 << 20];",
    "a write beyond the end": "out[1000 + get_global_id(0)] = 1;",
    "a data race": "out[0] = get_global_id(0);",
    "an uninitialised read": "int x; if (x > 3) out[get_global_id(0)] = x;",
    "nothing wrong": "out[get_global_id(0)] = 1;",
}


def chosen_cases() -> list[Axes]:
    """One of each tracker, of many media, majorants and tightnesses, with one lane or with four."""
    chosen = []
    for place, tracker in enumerate(catalog.load().trackers.values()):
        cases = cases_of(tracker)
        if not cases:
            continue  # of paths that scatter only
        chosen.append(cases[place % len(cases)] | {"lanes": (1, 4)[place % 2]})
    return chosen


def fly(rig: Rig, axes: Axes) -> dict[str, np.ndarray] | str:
    """The samples of a case, or what is wrong with it."""
    try:
        chosen = axes | {"majorant": WALKS.get(axes.get("majorant"), "global")}
        samples = rig.flight(rays={"chords": {"count": RAYS}}, **chosen).record(SAMPLES)
    except FreepathError as error:
        return f"{type(error).__name__}: {error}"
    return {"score": samples.score, "lookups": samples.lookups}


def launch(opened: Device, statement: str) -> str:
    """What is said of a kernel that consists of a statement."""
    text = f"__kernel void track(__global int *out) {{ {statement} }}"
    try:
        program = opened.build(Source(text, ()))
        out = opened.allocate(64)
        opened.write(out, np.zeros(16, np.int32))
        program.launch([out], 16, 1)
    except FreepathError as error:
        return f"{type(error).__name__}: {error}"
    return ""


def main(folder: Path) -> None:
    """Write what this process's device makes of all of it to a file in a folder."""
    (opened,) = device.open_devices(["all"])
    rig = Rig(opened, catalog.load(), folder)
    found: dict[str, Any] = {"info": opened.info}
    found["flights"] = {name_of(axes): fly(rig, axes) for axes in chosen_cases()}
    endless = {"tracker": "ratio", "estimand": "transmittance", "medium": "homogeneous"}
    if opened.info.loop_limit:
        found["endless"] = fly(rig, endless | {"tightness": 1e5, "lanes": 1})
    if opened.info.interpreted:
        found["defects"] = {name: launch(opened, text) for name, text in DEFECTS.items()}
    (folder / "found").write_bytes(pickle.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
