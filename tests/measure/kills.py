"""Sweeps that are killed, and sweeps with a case that kills: what is in the folder at the end.

    python tests/measure/kills.py [MOMENTS] [REPEATS]

Kills a sweep and the process that watches it at so many (20) random moments, each time going on by
--resume until it is complete: the table must be that of an undisturbed run in all but times. Then
so many (20) sweeps each with a kernel without end and one that ends its process: all must end, with
rows that say so. Exit code 1 where one does not.
"""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from freepath.results.folder import SAMPLE_COLUMNS, read_rows

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.measure.test_worker import FRONT, PLANTED  # noqa: E402

CONFIG = """name: kills
rays: {orthographic: {resolution: 4}}
matrix:
  medium: [{homogeneous: {sigma_t: 1}}, {exponential: {sigma_t: 2, scale_height: 1}}]
  tightness: [1, 1.5, 2, 2.5, 3]
  tracker: [delta, ratio]
stop: {samples: 64, rounds: 2}
"""
RUN = [sys.executable, "-m", "freepath", "run", "kills.yaml", "--trackers", "trackers"]
ENDS = {
    "hangs": ("timeout", ["-a", "tracker=delta,hangs", "-a", "tightness=1", "--timeout", "4"]),
    "aborts": ("crashed", ["-a", "tracker=delta,aborts", "-a", "tightness=1"]),
}
DIFFER = (
    "time",
    "inv_efficiency_s",
    "figure_of_merit",
    "lookups_per_s",
    "run_id",
    "device_time_share",
)
DIFFER += ("lane_occupancy",)  # which lane takes which unit depends on threads


def table(folder):
    """What does not depend on when it ran, by case; fails where a case is there twice."""
    rows = read_rows(Path(folder) / "summary.csv")
    found = {
        row["case"]: {name: row[name] for name in row if not name.startswith(DIFFER)}
        for row in rows
    }
    assert len(found) == len(rows)
    return found, read_rows(Path(folder) / "samples.csv", SAMPLE_COLUMNS)


def killed(moments):
    """Kill at random moments; tells whether all tables are those of an undisturbed run."""
    started = time.monotonic()
    subprocess.run([*RUN, "-o", "whole"], check=True, capture_output=True)
    took = time.monotonic() - started
    whole, rounds = table("whole")
    right, named, done, tables = 0, 0, 0, 0
    while done < moments:
        folder, code = f"killed-{done}", None
        before, lost = {}, 0
        while code != 0:
            resume = ["--resume"] if (Path(folder) / "summary.csv").exists() else []
            one = subprocess.Popen(
                [*RUN, "-o", folder, *resume], text=True, stderr=subprocess.PIPE,
                stdout=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip
            try:
                code = one.wait(random.uniform(0.2, 1) * took if done < moments else None)
            except subprocess.TimeoutExpired:
                _kill(one)
                done += 1
            named += "the run before was killed at work on" in one.stderr.read()
            if (Path(folder) / "summary.csv").exists():
                now, _ = table(folder)
                lost += len(before.keys() - now.keys())
                before = now
        found, of = table(folder)
        tables += 1
        right += found == whole and len(of) == len(rounds) and not lost
        print(f"{done} killed, {named} named the case; {folder}: {found == whole}, lost {lost}")
    return right == tables


def _kill(process):
    """Both at once."""
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    for pid in [process.pid, *map(int, listed)]:
        os.kill(pid, signal.SIGKILL)
    process.wait()


def ended(name, repeats):
    """How many sweeps with a case that kills ended with a row that says so."""
    status, words = ENDS[name]
    right = Counter()
    for turn in range(repeats):
        started = time.monotonic()
        done = subprocess.run(
            [*RUN, "-o", f"{name}-{turn}", *words], capture_output=True, check=False, timeout=600,
        )  # fmt: skip
        found, _ = table(f"{name}-{turn}")
        counts = Counter(row["status"] for row in found.values())
        right[done.returncode == 8 and counts == {"ok": 2, status: 2}] += 1
        print(f"{name} {turn}: {dict(counts)} in {time.monotonic() - started:.0f} s", flush=True)
    return right[True]


def main(moments=20, repeats=20):
    """Kill, and let be killed; returns the exit code."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        Path("trackers").mkdir()
        for name, line in PLANTED.items():
            Path(f"trackers/{name}.cl").write_text(FRONT.format(name, line))
        Path("kills.yaml").write_text(CONFIG)
        right = killed(moments)
        found = {name: ended(name, repeats) for name in ENDS}
        os.chdir("/")
    print(f"all tables are those of an undisturbed run: {right}; of {repeats} each: {found}")
    return int(not right or any(count < repeats for count in found.values()))


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
