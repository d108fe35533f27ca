"""Pictures of cases after the same device time: what an eye compares methods by.

Each case gets as many samples a pixel as its measured time of a sample leaves room for. They come
after those that it was measured with, so the errors of the picture are independent of the mean of
these, which tells what the picture should be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from freepath.errors import FreepathError
from freepath.measure.ladder import Ladder
from freepath.measure.pictures import (
    EQUAL_TIME,
    attributes_of,
    has_picture,
    picture,
    read_exr,
    stem,
    write_exr,
)
from freepath.measure.rounds import Bench, shape_of
from freepath.results.folder import Row

LOG = "pictures.log"
"""Within the folder of a run, where something went wrong."""
VISIBLE = 0.05
"""Relative RMSE of a pixel of the best case: noise that is seen."""
SHARE = 0.1
"""Of the best case's time it was measured in, at most: its mean has to tell what is an error."""
QUESTION = ("device", "platform", "medium", "channels", "estimand", "light", "scatterings")
"""Columns that cases have in common whose pictures are compared."""
LEAST_SAMPLES = 4
"""Of the slowest case: with fewer, times are equal but roughly."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A measured case that a picture can be made of."""

    row: dict[str, Any]
    bench: Bench
    rays: Any
    """The config's model of them."""
    unbiased: bool
    """Whether its mean may serve as a reference."""


def seconds_of(rows: Sequence[dict[str, Any]]) -> float:
    """Device seconds a pixel: the best case's noise is VISIBLE then, if the slowest can start."""
    least = LEAST_SAMPLES * max(row["time_per_sample_s"] for row in rows)
    return max(least, min(map(_visible, rows)))


def _visible(row: dict[str, Any]) -> float:
    scale = row["estimate"] if row["reference"] is None else row["reference"]
    per_sample = row["time_per_sample_s"]
    visible = Ladder(0.0, row["variance"], per_sample).time_to(VISIBLE * scale) if scale else 0.0
    return min(visible, SHARE * row["samples_per_ray"] * per_sample)


def render(folder: Path, shots: Sequence[Shot], rows: Sequence[Row] = ()) -> list[str]:
    """Write a picture of each case of one scene and device; returns what went wrong.

    `rows` are all of the run's: cases that a run which is gone on with had measured before have
    set the time already. Raises RunError where a launch fails.
    """
    told: list[str] = []
    groups: dict[tuple[str, ...], list[Shot]] = {}
    for shot in shots:
        if has_picture(shot.rays, shot.row["rays"]):
            groups.setdefault(_question(shot.row), []).append(shot)
    for question, group in groups.items():
        new = {shot.row["case_id"] for shot in group}
        others = [r for r in rows if _question(r) == question and r["case_id"] not in new]
        seconds = _seconds_before(folder, others) or seconds_of([shot.row for shot in group])
        told += filter(None, (_render(folder, shot, seconds) for shot in group))
    return told


def _question(row: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(str(row[name]) for name in QUESTION)


def _seconds_before(folder: Path, rows: Sequence[Row]) -> float | None:
    """The time that pictures of these rows were given; None if they have none that tells."""
    for row in rows:
        with suppress(FreepathError, KeyError, ValueError):
            told, _ = read_exr(folder / EQUAL_TIME / f"{stem(row)}.exr")
            return float(told["freepath:equal_time_s"])
    return None


def _render(folder: Path, shot: Shot, seconds: float) -> str:
    row, runner, found = shot.row, shot.bench.timed, shot.bench.measurement.moments
    per_sample = row["time_per_sample_s"]
    wanted = round(seconds / per_sample)
    shape = shape_of(wanted, runner.rays, per_sample, runner.lanes_in_all)
    one = runner.run(found.count, shape.samples, shape.blocks)
    samples = shape.per_ray
    resolution = shot.rays.resolution
    attributes = attributes_of(row) | {
        "freepath:samples": str(samples),
        "freepath:time_s": f"{one.time_s / row['rays']:.6g}",
        "freepath:equal_time_s": f"{seconds:.6g}",
        "freepath:unbiased": str(int(shot.unbiased)),
    }
    base = folder / EQUAL_TIME / stem(row)
    try:
        base.parent.mkdir(parents=True, exist_ok=True)
        error = picture(found.variance / samples, resolution)
        write_exr(base, picture(one.moments.mean, resolution), error, attributes)
    except (OSError, FreepathError) as problem:
        return f"no picture at equal time of {row['case']}: {problem}"
    return ""
