"""`freepath recommend`: which tracker and majorant are the fastest in a volume of one's own."""

from __future__ import annotations

import argparse
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shtab

from freepath.commands.arguments import (
    add_baseline,
    add_device,
    add_trackers,
    expression,
    number_or_percent,
    positive,
)

if TYPE_CHECKING:
    from freepath.show.answers import Case


def add(commands: Any) -> None:
    """Declare its arguments."""
    recommend = commands.add_parser(
        "recommend",
        help="find the tracker and majorant that are the fastest in a volume",
        description="Measure trackers, majorants and tightness in a volume, ever fewer of them "
        "ever longer, and say which is the first to reach an accuracy, how sure that is, and "
        "what comes next. Writes a config that measures them again.",
        allow_abbrev=False,
    )
    recommend.add_argument(
        "volume", type=Path, metavar="VOLUME", help="a .vdb, .exr, .tif or .npy file"
    ).complete = shtab.FILE
    recommend.add_argument(
        "--accuracy",
        type=_accuracy,
        default=0.01,
        metavar="A",
        help="relative RMSE to be reached, e.g. 1%% or 0.01 (default: 1%%)",
    )
    recommend.add_argument(
        "--estimand", choices=("transmittance", "free_path"), default="transmittance"
    )
    recommend.add_argument(
        "--sigma-t",
        type=positive,
        default=1.0,
        metavar="X",
        help="extinction where the volume's density is 1 (default: 1)",
    )
    recommend.add_argument("--grid", metavar="NAME", help="which grid of an OpenVDB file")
    recommend.add_argument(
        "--budget",
        type=positive,
        default=30.0,
        metavar="SECONDS",
        help="of measuring, in all; compilation comes on top (default: 30)",
    )
    recommend.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="folder for results and config (default: results/recommend-NAME-TIME)",
    ).complete = shtab.DIRECTORY
    recommend.add_argument(
        "-R",
        "--include",
        type=expression,
        default="",
        metavar="RE",
        help="only trackers whose name matches",
    )
    add_baseline(recommend)
    add_device(recommend, "part of the name, platform or driver of the device")
    add_trackers(recommend)


def _accuracy(text: str) -> float:
    value = number_or_percent(text)
    if not 1e-6 <= value < 1.0:
        raise argparse.ArgumentTypeError(
            f"expected a relative error such as 1% or 0.01, from 1e-6 to below 1, got '{text}'"
        )
    return value


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath.commands.common import console_of, volume_of
    from freepath.commands.run import _shown_progress
    from freepath.compose import catalog
    from freepath.device.selection import first
    from freepath.errors import UsageError
    from freepath.extras import recommend
    from freepath.measure.sweep import Clock
    from freepath.results.folder import new_folder
    from freepath.show import answers

    clock = Clock()
    medium = {"volume": volume_of(options.volume, options.sigma_t, options.grid)}
    known = catalog.load(options.trackers)
    folder = options.output or new_folder(f"recommend-{options.volume.stem}")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder}: expected a folder that is empty or not there yet")
    part = first(options.device)
    console = console_of()
    told = {"highlight": False, "markup": False, "soft_wrap": True}
    with _shown_progress(console, rows=False) as listener:
        search = recommend.Search(
            known,
            part,
            folder,
            medium,
            options.estimand,
            options.accuracy,
            options.budget,
            listener,
            clock,
            options.include,
        )
        finalists = search.run()
    console.print(
        f"{options.volume.name}, {options.estimand} to {100 * options.accuracy:g} %, on "
        f"{part.infos[0].label}",
        **told,
    )
    cases = [one.case for one in search.found.values()]
    for line in [
        *told_of([one.case for one in finalists]),
        answers.sentence(cases, options.accuracy, options.baseline),
    ]:
        console.print(line, **told)
    console.print(
        f"{search.measured} cases measured in {clock.outside_s:.0f} s, and {clock.build_s:.0f} s "
        f"of compilation\nwrote {search.write(finalists)}",
        **told,
    )
    return 0


def told_of(finalists: list[Case]) -> list[str]:
    """The best, how sure that is, and what the others take."""
    from freepath.extras.recommend import surely
    from freepath.show.table import seconds

    best, *others = finalists
    low, high = (best.time_s * max(0.0, 1 + sign * best.noise) for sign in (-1, 1))
    lines = [
        f"fastest: {best.case}",
        f"  {seconds(best.time_s)} of device time per ray "
        f"(95 %: {seconds(low)} to {seconds(high)})",
    ]
    for place, one in enumerate(others):
        what = "second" if place == 0 else "then"
        line = f"{seconds(one.time_s)}, {one.time_s / best.time_s:.2f} times as long; "
        sure = f"that it is slower is {100 * surely(best, one):.0f} % sure"
        lines += [f"{what}: {one.case}", f"  {line}{sure if one.settled else 'not known'}"]
    return lines
