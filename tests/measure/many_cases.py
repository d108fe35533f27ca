"""What the harness takes for each of many tiny cases, and for looking at their results.

    python tests/measure/many_cases.py [CASES] [--profile]

Runs so many cases (10,000), twice, compares the two results and reports one. Prints the CPU time of
the thread that does it, which is what the harness takes beside the device's work, and the growth
of its memory after the first fifth. Exit code 1 where a case takes 5 ms, a comparison or a report
of 10,000 rows 5 s, or memory grows by more than 2 kB a case.
"""

import contextlib
import cProfile
import os
import pstats
import sys
import tempfile
import time
from pathlib import Path

import psutil

from freepath import api, cli
from freepath.device.selection import one_device

MEDIA = 10
CONFIG = """name: many
rays: {{orthographic: {{resolution: 4}}}}
matrix:
  medium: [{media}]
  tracker: delta
  tightness: [{tightness}]
stop: {{samples: 64, rounds: 2}}
"""
MOST_S, MOST_OF_A_LOOK_S, MOST_GROWTH = 5e-3, 5.0, 2e3


class Looking:
    """Notes the memory after a fifth of the rows, and at the end."""

    def __init__(self, count):
        self.count, self.rows, self.memory = count, 0, []

    def __call__(self, row):
        self.rows += 1
        if self.rows in (self.count // 5, self.count):
            self.memory.append(psutil.Process().memory_info().rss)


@contextlib.contextmanager
def timed(what, times, profile):
    """Note the CPU time of this thread."""
    profiler, start = cProfile.Profile(), time.thread_time()
    if profile:
        profiler.enable()
    yield
    times[what] = time.thread_time() - start
    if profile:
        profiler.disable()
        pstats.Stats(profiler).sort_stats("cumtime").print_stats(40)


def main(count=10_000, *, profile=False):
    """Measure and print; returns the exit code."""
    device, times = one_device([]), {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["FREEPATH_CACHE"] = str(folder / "cache")
        media = ", ".join(f"homogeneous: {{sigma_t: {1 + n}}}" for n in range(MEDIA))
        tightness = ", ".join(str(1 + n / 1000) for n in range(count // MEDIA))
        (folder / "many.yaml").write_text(CONFIG.format(media=media, tightness=tightness))
        for run in ("a", "b"):
            sweep = api.sweep(folder / "many.yaml", folder / run, devices=[device])
            sweep.listener.row = looking = Looking(count)
            with timed(f"run {run}", times, profile and run == "a"):
                sweep.run()
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
            cli.main(["report", str(folder / "a")])  # makes the script of the page, once
        for words in (["compare", "a", "b"], ["report", "a"]):
            paths = [str(folder / word) for word in words[1:]]
            with (
                timed(words[0], times, profile),
                open(os.devnull, "w") as nowhere,
                contextlib.redirect_stdout(nowhere),
            ):
                cli.main([words[0], *paths])
    a_case = min(times["run a"], times["run b"]) / count
    growth = (looking.memory[1] - looking.memory[0]) / (0.8 * count)
    looks = {what: round(times[what], 2) for what in ("compare", "report")}
    print(f"a case {1e3 * a_case:.2f} ms, memory {growth:+.0f} B a case; of {count} rows: {looks}")
    over = max(looks.values()) > MOST_OF_A_LOOK_S
    return int(a_case > MOST_S or growth > MOST_GROWTH or over)


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if word != "--profile"]
    sys.exit(main(*map(int, words), profile="--profile" in sys.argv))
