"""Does `freepath recommend` find what a full sweep finds? Runs both.

`python tests/support/full_sweep.py VOLUME SIGMA_T -o DIR [--budget S] [--seconds S]` searches with
the budget, then measures every case of the search for so many seconds each, and prints what was
recommended, the fastest cases of the sweep, and how the recommended one stands among these.
"""

import argparse
import math
from pathlib import Path

from freepath import api
from freepath.compose import catalog
from freepath.device.selection import first
from freepath.extras import recommend
from freepath.extras.given import volume_of
from freepath.measure import worker
from freepath.measure.sweep import Clock, Listener
from freepath.show.answers import at_accuracy
from freepath.show.table import seconds


def search_of(options: argparse.Namespace) -> recommend.Search:
    """The search that `freepath recommend` makes."""
    options.output.mkdir(parents=True, exist_ok=True)
    return recommend.Search(
        catalog.load(),
        first([options.device] if options.device else []),
        options.output,
        {"volume": volume_of(options.volume, options.sigma_t)[1]},
        options.estimand,
        options.accuracy,
        options.budget,
        Listener(),
        Clock(),
    )


def every(search: recommend.Search) -> list[recommend.Axes]:
    """The cases that the search is over: what a full sweep measures."""
    shape, side = search.voxels()
    return [
        {"tracker": tracker, "majorant": majorant, "tightness": tightness}
        for tracker in search.trackers(side)
        for majorant in recommend.majorants_of(shape)
        for tightness in recommend.TIGHTNESS
    ]


def full_sweep(search: recommend.Search, at_most_s: float) -> dict[str, tuple[float, float]]:
    """Device seconds a ray to the accuracy and its noise, by the case's name."""
    stop = recommend.PRECISION[-1] | {"at_most": f"{at_most_s:g} s"}
    path = search.folder / "full.yaml"
    path.write_text(search.config_text(every(search), stop), "utf-8")
    sweep = api.sweep(path, path.with_suffix(""), known=search.known, clock=search.clock)
    worker.run(sweep, search.part)
    found = {row["case"]: at_accuracy(row, search.accuracy) for row in sweep.folder.rows()}
    return {
        name: (one.time_s, one.noise) if one else (math.inf, 0.0) for name, one in found.items()
    }


def arguments() -> argparse.Namespace:
    """What was typed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("volume", type=Path)
    parser.add_argument("sigma_t", type=float)
    parser.add_argument("--estimand", default="transmittance")
    parser.add_argument("--accuracy", type=float, default=0.01)
    parser.add_argument("--budget", type=float, default=20.0)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("-d", "--device")
    parser.add_argument("-o", "--output", type=Path, required=True)
    return parser.parse_args()


def main() -> None:
    """Run both and print."""
    options = arguments()
    search = search_of(options)
    finalists = search.run()
    took = (search.clock.outside_s, search.clock.build_s)
    print(f"{options.volume.name}, {options.estimand}, {search.part.infos[0].label}")
    print("\n".join(recommend.told_of(finalists, search.side)))
    times = full_sweep(search, options.seconds)
    outside, build = search.clock.outside_s - took[0], search.clock.build_s - took[1]
    print(f"\nfull sweep of {len(times)} cases, the fastest:")
    for name, (time_s, noise) in sorted(times.items(), key=lambda one: one[1][0])[:5]:
        print(f"  {name}  {seconds(time_s)} +- {100 * noise:.1f} %")
    ratio = times[finalists[0].case.case][0] / min(time_s for time_s, _ in times.values())
    print(f"recommended / fastest of the sweep: {ratio:.3f}")
    print(
        f"took {took[0]:.0f} s and {took[1]:.0f} s of compilation; the sweep {outside:.0f} s and "
        f"{build:.0f} s: {took[0] / outside:.3f} of its time, with compilation "
        f"{sum(took) / (outside + build):.3f}"
    )


if __name__ == "__main__":
    main()
