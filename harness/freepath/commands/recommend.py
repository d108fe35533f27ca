"""`freepath recommend`: which tracker and majorant are the fastest in a volume of one's own."""

from __future__ import annotations

import argparse
from argparse import Namespace
from typing import Any

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
    from freepath.commands.common import console_of
    from freepath.commands.run import _shown_progress
    from freepath.extras.recommend import recommend

    console = console_of()
    asked = ("volume", "accuracy", "estimand", "renderer", "grid", "budget", "sigma_t", "output")
    asked += ("include", "baseline", "trackers", "raw")
    with _shown_progress(console, rows=False) as listener:
        given = {name: getattr(options, name) for name in asked}
        more = {"devices": options.device, "timeout_s": options.timeout, "listener": listener}
        found = recommend(**given, **more)
    console.print(found, highlight=False, markup=False, soft_wrap=True)
    return INTERRUPTED if found.interrupted else 0
