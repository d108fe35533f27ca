"""Tries a comparison on reruns of one sweep: false alarms, and what of planted changes is found.

    python tests/support/trials.py RERUNS [--runs K] [--tries N]

RERUNS holds a folder for each rerun. A try draws two disjoint sets of K reruns at random, so that
reference and contender have the noise, the drift and the load that runs of this machine have.
"""

from __future__ import annotations

import argparse
import copy
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

from freepath.show.compare.judging import Settings, compare
from freepath.show.compare.pairing import Key, Run, Side, load
from freepath.show.compare.timing import effects

Plant = Callable[[Side, Key], None]


def slowed(side: Side, key: Key, factor: float = 1.05) -> None:
    """Plant a slowdown into a case of a side, of every one of its rounds."""
    for run in side.runs:
        run.effects = None
        run.times[key] = {n: factor * t for n, t in run.times[key].items()}


def biased(side: Side, key: Key, share: float = 0.01) -> None:
    """Plant a bias into a case of a side. Its seed changes, or the same samples would betray it."""
    for run in side.runs:
        row = run.rows[key]
        moved = float(row["estimate"]) + share * float(row["reference"])
        run.rows[key] = row | {"estimate": repr(moved), "seed": "-1"}


def copied(name: str, runs: list[Run]) -> Side:
    """A side of these runs that can be changed without changing them."""
    return Side(name, [replace(run, rows=dict(run.rows), times=dict(run.times)) for run in runs])


def trial(
    runs: list[Run], k: int, random: np.random.Generator, settings: Settings, plant: Plant | None
) -> bool:
    """One comparison of k runs with k others: whether a planted change, or else any, was found."""
    drawn = random.choice(len(runs), 2 * k, replace=False)
    reference = copied("reference", [runs[i] for i in drawn[:k]])
    contender = copied("contender", [runs[i] for i in drawn[k:]])
    key = None
    if plant:
        keys = sorted(key for key, row in reference.rows.items() if row["status"] == "ok")
        key = keys[random.integers(len(keys))]
        plant(contender, key)
    judged, _ = compare(reference, contender, settings)
    return any(one.regressed and key in (None, one.key) for one in judged)


def rate(
    runs: list[Run], k: int, tries: int, settings: Settings, plant: Plant | None = None
) -> tuple[int, float, float]:
    """How many tries found something, and the 95 % interval of their share (Clopper, Pearson)."""
    random = np.random.default_rng(2024)
    for run in runs:
        effects(run)  # kept with it, and so with its copies
    found = sum(trial(runs, k, random, settings, plant) for _ in range(tries))
    low, high = stats.binomtest(found, tries).proportion_ci(0.95)
    return found, float(low), float(high)


def main(arguments: list[str] | None = None) -> int:
    """Print the rates; returns the exit code."""
    parser = argparse.ArgumentParser(prog="trials.py")
    parser.add_argument("reruns", type=Path, help="a folder with a folder for each rerun")
    parser.add_argument("--runs", type=int, nargs="+", default=[1], help="runs per side")
    parser.add_argument("--tries", type=int, default=1000, help="A/A comparisons")
    parser.add_argument("--planted", type=int, default=200, help="tries with a planted change")
    options = parser.parse_args(arguments)
    runs, settings = load(options.reruns).runs, Settings()
    rounds = np.median([len(t) for run in runs for t in run.times.values()])
    print(f"{len(runs)} reruns, {len(runs[0].rows)} cases, {rounds:.0f} rounds a case")
    for k in options.runs:
        if 2 * k > len(runs):
            print(f"{k} runs per side take {2 * k} reruns", file=sys.stderr)
            return 2
        for what, tries, plant in (
            ("false alarms", options.tries, None),
            ("5 % slower, found", options.planted, slowed),
            ("1 % biased, found", options.planted, biased),
        ):
            found, low, high = rate(copy.copy(runs), k, tries, settings, plant)
            print(f"{k} runs per side: {what} {found} of {tries} ({low:.1%} to {high:.1%})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
