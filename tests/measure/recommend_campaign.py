"""Is `freepath recommend` to be trusted? On three volumes from thin to dense, and with 30 seeds.

`python tests/measure/recommend_campaign.py -o DIR [--budget S] [--seeds N] [VOLUME...]` recommends
in each volume at each sigma_t, then with other seeds in the first, and prints a line for each. What
is recommended must be no slower than twice the best of what the search itself had measured, and no
case whose interval holds 0. Exit code 1 where that fails. Volumes are looked for in
$FREEPATH_VOLUMES; all of it takes some 15 minutes on two cores with nothing else running.
"""

import argparse
import sys
from pathlib import Path

import freepath
from freepath.errors import RunError
from freepath.results.folder import SUMMARY, read_rows
from freepath.show import answers
from freepath.show.table import seconds

SCALES = {
    "wdas_cloud_sixteenth.vdb": 1.0,
    "les_rico122_ext_per_km.npy": 0.4,
    "cranium_bone_u8.npy": 0.04,
}
"""Of sigma_t, so that all volumes are about as dense as the first."""
SIGMA_T = (0.01, 0.05, 1.0, 20.0)
LATE = 2.0
SEED_SIGMA_T = 1.0
"""The default, at which much of the variance of weighted trackers is in rare scores."""


def measured(folder):
    """Each case of each round that reaches 1 % and whose time is known well enough."""
    for path in sorted(folder.glob(f"round-*/{SUMMARY}")):
        found = (answers.at_accuracy(row, 0.01) for row in read_rows(path))
        yield from (one for one in found if one and one.settled)


def judged(folder, volume, sigma_t, budget, **more):
    """What was recommended and how late that is; whether it holds."""
    asked = {"sigma_t": sigma_t, "budget": budget, "output": folder, **more}
    try:
        best = freepath.recommend(volume, **asked).best
    except RunError as error:
        known = list(measured(folder))
        return f"none: {str(error).split(':')[0]}; known were {len(known)}", not known
    least = min((one.time_s for one in measured(folder)), default=best.time_s)
    late = best.time_s / least
    told = f"{best.name}, {seconds(best.time_s)} +- {100 * best.noise:.0f} %, {late:.2f} x the best"
    return told, late <= LATE and best.noise < 1.0


def main():
    """Run both parts; 1 where something does not hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("volumes", nargs="*", default=list(SCALES), metavar="VOLUME")
    parser.add_argument("--budget", type=float, default=20.0)
    parser.add_argument("--seed-budget", type=float, default=6.0)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--sigma-t", type=float, nargs="*", default=SIGMA_T)
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    failed = 0
    runs = [
        (f"{volume}, sigma_t {SCALES.get(volume, 1.0) * sigma_t:g}", volume, sigma_t, {})
        for volume in options.volumes
        for sigma_t in options.sigma_t
    ]
    runs += [
        (f"seed {seed}", options.volumes[0], SEED_SIGMA_T, {"seed": seed})
        for seed in range(1, options.seeds + 1)
    ]
    for place, (name, volume, sigma_t, more) in enumerate(runs):
        budget = options.seed_budget if more else options.budget
        scaled = SCALES.get(volume, 1.0) * sigma_t
        told, holds = judged(options.output / str(place), volume, scaled, budget, **more)
        failed += not holds
        print(f"{name}: {told}{'' if holds else '  FAILED'}", flush=True)
    print(f"{failed} of {len(runs)} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
