"""Kernels of the first version beside those of today, for cases that use nothing that came since.

`git worktree add FIRST 20e1c6d`, then there `freepath source CASES.yaml --case N > N.cl` for the
cases that this script prints as CASES.yaml without arguments. `python
tests/measure/first_kernels.py DEVICE
ROUNDS FOLDER` with the folder of those files times both sources side by side and compares means.
"""

import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from freepath.checks.rig import Rig
from freepath.compose import catalog
from freepath.compose.source import Source
from freepath.device.opencl import open_devices

ROUND_S = 0.15
RESAMPLED = 2000
RAYS = {"orthographic": {"resolution": 32}}
MEDIA = ({"homogeneous": {"sigma_t": 4}}, {"cloud": {"resolution": 64, "sigma_t": 50}})
MAJORANTS = ("global", {"grid": {"resolution": 8}})
CASES = [
    {"estimand": "transmittance", "medium": medium, "majorant": majorant, "tracker": tracker}
    for medium in MEDIA
    for majorant in MAJORANTS
    for tracker in ("delta", "ratio")
]


REPAIR = (
    "draw = choose(crossing, larger(left, (real)0), draw);",
    "draw = choose(crossing, left, draw);",
)
"""Of the walk from cell to cell, which before could collide with a majorant of 0."""


def ratio(ratios: np.ndarray) -> str:
    """The median and its 95 % interval, by the bootstrap."""
    drawn = np.random.default_rng(2).choice(ratios, (RESAMPLED, len(ratios)))
    low, high = np.percentile(np.median(drawn, axis=1), [2.5, 97.5])
    return f"{np.median(ratios):.3f} ({low:.3f} to {high:.3f})"


def row(rig: Rig, axes: dict, first: str, rounds: int) -> str:
    """Time both sources of a case in rounds of random order."""
    now = rig.flight(count=False, record=False, rays=RAYS, **axes).runner
    options = now.program.source.options
    then = replace(now, program=rig.program(Source(first, options)))
    bare = Source(now.program.source.text.replace(*REPAIR), options)
    runners = (then, now, replace(now, program=rig.program(bare)))
    random = np.random.default_rng(1)
    means = [runner.run(0, 256, 2).moments.mean for runner in runners]
    one = now.run(0, 256, 2)
    blocks = max(2, int(2 * ROUND_S / one.time_s))
    times = np.empty((rounds, 3))
    for turn in range(rounds):
        for place in random.permutation(3):
            times[turn, place] = runners[place].run(0, 256, blocks).time_per_sample_s
    same = "equal" if np.array_equal(*means[:2]) else "different"
    name = ", ".join(next(iter(v)) if isinstance(v, dict) else v for v in list(axes.values())[1:])
    columns = [ratio(times[:, place] / times[:, 0]) for place in (1, 2)]
    columns[1] = columns[1] if REPAIR[0] in now.program.source.text else "the same"
    return f"| {name} | {1e9 * np.median(times[:, 0]):.1f} | {' | '.join(columns)} | {same} |"


def main(device: str, rounds: int, folder: Path) -> None:
    """Print a row of a table for each case."""
    opened = open_devices([device])[0]
    print(f"{opened.info.platform} {opened.info.driver_version}, {opened.info.lanes} lanes\n")
    print("| case | first, ns a sample | today / first | without the repair | means of rays |")
    print("| --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as work:
        rig = Rig(opened, catalog.load(), Path(work))
        for number, axes in enumerate(CASES, start=1):
            first = (folder / f"{number}.cl").read_text("utf-8")
            print(row(rig, axes, first, rounds), flush=True)


if len(sys.argv) == 1:
    head = {"name": "first", "seed": 7, "rays": RAYS}
    print(json.dumps(head | {"matrix": CASES[0], "include": CASES[1:]}))
else:
    main(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]))
