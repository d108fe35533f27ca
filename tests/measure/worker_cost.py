"""What it costs in measured times that a sweep runs in a process that is watched.

    python tests/measure/worker_cost.py [TURNS]

Sweeps of the same cases in this process and in a watched one take turns. Prints, for each case, the
ratio of device times per sample, watched over not, with its 95 % interval from the turns. Leave the
machine alone meanwhile. Exit code 1 where an interval lies above 1: the watching costs time.
"""

import math
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy import stats

from freepath import api
from freepath.device.selection import first, one_device
from freepath.measure import worker

CONFIG = """name: cost
rays: {orthographic: {resolution: 32}}
matrix:
  medium: [{homogeneous: {sigma_t: 3}}, {cloud: {resolution: 32, sigma_t: 10}}]
  tracker: [delta, ratio]
stop: {samples: 20000, rounds: 10}
"""


def times(folder):
    """Seconds of a sample of each case."""
    found = api.read_rows(folder / "summary.csv")
    return {row["case"]: float(row["time_per_sample_s"]) for row in found}


def main(turns=8):
    """Measure and print; returns the exit code."""
    part, device, ratios = first([]), one_device([]), defaultdict(list)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cost.yaml").write_text(CONFIG)
        for turn in range(turns):
            here, there = folder / f"here-{turn}", folder / f"there-{turn}"
            for one in (here, there) if turn % 2 else (there, here):
                sweep = api.sweep(folder / "cost.yaml", one, devices=[device] * (one == here))
                if one == here:
                    sweep.run()
                else:
                    worker.run(sweep, part)
            before, after = times(here), times(there)
            for case, seconds in after.items():
                ratios[case].append(math.log(seconds / before[case]))
    slower = False
    for case, logs in ratios.items():
        half = stats.t.ppf(0.975, turns - 1) * np.std(logs, ddof=1) / math.sqrt(turns)
        low, middle, high = np.exp(np.mean(logs) + half * np.array([-1, 0, 1]))
        slower |= low > 1.0
        print(f"{middle:.4f} ({low:.4f} to {high:.4f})  {case}")
    return int(slower)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
