"""Is `freepath recommend` to be trusted? On three volumes from thin to dense, and with 30 seeds.

`python tests/measure/recommend_campaign.py -o DIR [--budget S] [--seeds N] [VOLUME...]` recommends
in each volume at each sigma_t, then with other seeds in the first, and prints a line for each. What
is recommended must be no slower than twice the best of what the search itself had measured, and no
case whose interval holds 0; where the machine was too busy to know, it must be refused, which is
counted. Exit code 1 where that fails. Volumes are looked for in
$FREEPATH_VOLUMES; all of it takes some 15 minutes on two cores with nothing else running.
"""

import argparse
import sys
from pathlib import Path

import freepath
from freepath.errors import RunError
from freepath.results.folder import SUMMARY, read_rows
from freepath.show import answers
from freepath.show.table import seconds, settled

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
    """What each case of each round takes to 1 % at most, of those that never went wrong.

    Of what is not known well enough to be ranked, as its time alone is noisy, the end of its
    interval; what rare scores carry is left out, for its interval holds anything.
    """
    rows = [row for path in folder.glob(f"round-*/{SUMMARY}") for row in read_rows(path)]
    wrong = {row["case"] for row in rows if row["status"] != "ok"}
    for row in rows:
        one = None if row["case"] in wrong else answers.at_accuracy(row, 0.01)
        if one and one.settled:
            yield one.time_s
        elif one and row["variance_noise"] and settled(float(row["variance_noise"])):
            yield one.time_s * (1.0 + one.noise)


def judged(folder, volume, sigma_t, budget, **more):
    """What was recommended and how late that is; whether it holds."""
    asked = {"sigma_t": sigma_t, "budget": budget, "output": folder, **more}
    try:
        best = freepath.recommend(volume, **asked).best
    except RunError as error:
        told = str(error).split("; what was")[0]
        doubted = told.startswith("the fastest is not known")
        return f"refused: {told}", doubted or not any(measured(folder))
    late = best.time_s / min(measured(folder), default=best.time_s)
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
    failed = refused = 0
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
        refused += told.startswith("refused")
        print(f"{name}: {told}{'' if holds else '  FAILED'}", flush=True)
    print(f"{failed} of {len(runs)} failed, {refused} were refused")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
