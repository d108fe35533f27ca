"""`freepath recommend`: which tracker and majorant are the fastest in a volume of one's own."""

from __future__ import annotations

import argparse
from argparse import Namespace
from typing import TYPE_CHECKING, Any

from freepath.commands.arguments import (
    add_baseline,
    add_device,
    add_output,
    add_sigma_t,
    add_timeout,
    add_trackers,
    add_volume,
    expression,
    number_or_percent,
    positive,
)
from freepath.errors import INTERRUPTED

if TYPE_CHECKING:
    from freepath.extras.recommend import Finding, Search
    from freepath.extras.renderers import Renderer


DEFAULT = "sigma_t is the default, 1: another may have another fastest; give yours by --sigma-t"


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
    add_volume(recommend)
    recommend.add_argument(
        "--accuracy",
        type=_accuracy,
        default=0.01,
        metavar="A",
        help="relative RMSE to be reached, e.g. 1%% or 0.01 (default: 1%%)",
    )
    recommend.add_argument(
        "--estimand",
        choices=("transmittance", "free_path"),
        default="transmittance",
        help="transmittance: shadow rays, how much light comes through; free_path: paths, where "
        "they collide next (default: transmittance)",
    )
    recommend.add_argument(
        "--for",
        dest="renderer",
        choices=("mitsuba", "pbrt", "cycles"),
        help="recommend what this renderer has, with its settings, and what the rest would gain",
    )
    recommend.add_argument(
        "--budget",
        type=positive,
        default=30.0,
        metavar="SECONDS",
        help="of measuring, in all; compilation comes on top (default: 30)",
    )
    add_sigma_t(recommend)
    add_output(recommend, "results and config", "recommend-NAME")
    add_timeout(recommend)
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
    from freepath.commands.common import console_of, own_folder, volume_of
    from freepath.commands.run import _shown_progress
    from freepath.compose import catalog
    from freepath.device.selection import first
    from freepath.errors import RunError
    from freepath.extras.recommend import OVER, Search
    from freepath.extras.renderers import RENDERERS
    from freepath.measure.sweep import Clock
    from freepath.results.folder import new_folder
    from freepath.show import answers

    clock = Clock()
    _, keys = volume_of(options.volume, options.sigma_t, grid=options.grid, raw=options.raw)
    medium = {"volume": keys}
    known = catalog.load(options.trackers)
    part = first(options.device)
    folder = options.output or new_folder(f"recommend-{options.volume.stem[:60]}")
    own_folder(folder, "recommend")
    console = console_of()

    def say(*lines: str) -> None:
        for line in filter(None, lines):
            console.print(line, highlight=False, markup=False, soft_wrap=True)

    asked = (medium, options.estimand, options.accuracy, options.budget)
    interrupted = ""
    with _shown_progress(console, rows=False) as listener:
        renderer = RENDERERS.get(options.renderer)
        more = options.include, renderer, options.timeout
        search = Search(known, part, folder, *asked, listener, clock, *more)
        try:
            search.run()
        except KeyboardInterrupt:
            interrupted = "interrupted; what is known so far:"
        finally:
            search.keep()
    say(
        interrupted,
        f"{options.volume.name}, {options.estimand} to {100 * options.accuracy:g} %, on "
        f"{part.infos[0].label}",
        search.dense,
        DEFAULT if options.sigma_t is None else "",
    )
    try:
        finalists = search.finalists()
    except RunError as error:
        if not interrupted:
            raise
        say(str(error))
        return INTERRUPTED
    mine = [one.case for one in search.found.values() if search.is_had(one)]
    say(*told_of(finalists, search.side))
    say(answers.sentence(mine, options.accuracy, options.baseline))
    say(*(_told_for(renderer, finalists[0], search) if renderer else ()), search.edge)
    if search.lacks or search.spent_s > OVER * options.budget:
        lacks = "; ".join(search.lacks) or "no case can be given less than 0.05 s"
        took = f"{search.spent_s:.1f} s were taken; not measured: {lacks}"
        say(f"the budget of {options.budget:g} s was too little: {took}")
    say(
        f"{search.measured} cases measured in {clock.outside_s:.0f} s, and {clock.build_s:.0f} s "
        f"of compilation",
        f"wrote {search.write(finalists)}; to look at all of it: freepath report {folder}",
    )
    return INTERRUPTED if interrupted else 0


def told_of(finalists: list[Finding], side: float) -> list[str]:
    """The best, how sure that is, and what the others take; a voxel's side is in the world."""
    from freepath.show import answers
    from freepath.show.table import seconds

    best, *others = (one.case for one in finalists)
    low, high = (best.time_s * max(0.0, 1 + sign * best.noise) for sign in (-1, 1))
    lines = [
        f"fastest: {best.case}",
        f"  {seconds(best.time_s)} of device time per ray "
        f"(95 %: {seconds(low)} to {seconds(high)})",
    ]
    if step := next(iter(finalists[0].axes["tracker"].values())).get("step"):
        lines.append(f"  its step: {step / side:.3g} x a voxel, {step:.4g} in units of the scene")
    for place, one in enumerate(others):
        what = "second" if place == 0 else "then"
        middle, low, high = map(answers.digits, answers.ratio(one, best))
        times = f"{middle} ({low} to {high}) times as long" if one.settled else "not known"
        lines += [f"{what}: {one.case}", f"  {seconds(one.time_s)}, {times}"]
    return lines


def _told_for(renderer: Renderer, best: Finding, search: Search) -> list[str]:
    """What to set in a renderer, how biased that is, and what it costs not to have the rest."""
    from freepath.show import answers

    bias = f"it is biased by {100 * best.case.bias:.1g} %"
    known = [one.case for one in search.found.values() if one.case.settled]
    fastest = min(known, key=lambda one: one.time_s)
    gain = "nothing that was measured is faster"
    if fastest is not best.case:
        gain = f"{fastest.name} would be {answers.times_as_fast(best.case, fastest)}"
    return [
        f"in {renderer.title}: {renderer.settings(best.axes, search.side)}",
        f"  {bias if best.case.biased else 'it has no measurable bias'}; of what it lacks: {gain}",
        f"  settings from {renderer.source}",
    ]
