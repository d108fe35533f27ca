"""Pictures of a result: what accuracy costs in time, from the rows of summary.csv alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from freepath.errors import FreepathError
from freepath.results import SUMMARY, read_rows
from freepath.table import Row, by_device, group_key, number

FORMATS = (".svg", ".png")
DEEPEST, HIGHEST = 1e-4, 10.0
"""Relative errors between which a picture shows the curves."""
LONGEST = 1e5
"""A panel ends where its fastest case has run this often, unless all have met DEEPEST before."""
POINTS = 64


def relative(row: Row) -> tuple[float, float]:
    """Variance of a sample and bias, relative to the reference (squared for the variance)."""
    reference = abs(number(row, "reference"))
    bias = (number(row, "bias_rms") or 0.0) / reference
    return number(row, "variance") / reference**2, bias


def curve(row: Row, end_s: float) -> list[dict[str, float]]:
    """Relative RMSE over device seconds a ray: sqrt(bias^2 + variance t_sample / t) / reference.

    From the time of one sample, where no less can be spent, to end_s.
    """
    variance, bias = relative(row)
    start = number(row, "time_per_sample_s")
    points = []
    for i in range(POINTS + 1):
        samples = max(1.0, end_s / start) ** (i / POINTS)
        error = math.sqrt(bias**2 + variance / samples)
        points.append({"time_s": start * samples, "error": max(error, DEEPEST), "samples": samples})
    return points


def _end(rows: list[Row]) -> float:
    """Where a panel's time axis ends."""
    starts = [number(row, "time_per_sample_s") for row in rows]
    met = [s * relative(row)[0] / DEEPEST**2 for s, row in zip(starts, rows, strict=True)]
    return max(2 * max(starts), min(LONGEST * min(starts), max(met)))


def records(rows: list[Row]) -> list[dict[str, Any]]:
    """One record a point of a curve, with what the chart tells its lines apart by."""
    end = _end(rows)
    return [
        point
        | {
            "tracker": row["case"].split("/")[-3] + _variant(row, rows),
            "majorant": _majorant(row),
            "first": i == 0,
        }
        for row in rows
        for i, point in enumerate(curve(row, end))
    ]


def _majorant(row: Row) -> str:
    return "none" if row["majorant"] == "none" else f"{row['majorant']} x{row['tightness']}"


def _variant(row: Row, rows: list[Row]) -> str:
    """Lanes and arithmetic, where a result has several."""
    texts = {"lanes": f"{row['lanes']} lanes", "arithmetic": row["arithmetic"]}
    several = [column for column in texts if len({other[column] for other in rows}) > 1]
    return "".join(f", {texts[column]}" for column in several)


def chart(rows: list[Row], columns: int = 2) -> Any:
    """The cost of accuracy, a panel for each medium and estimand (an altair chart)."""
    import altair

    altair.data_transformers.disable_max_rows()
    device = next(iter(by_device(rows)))
    panels = [_panel(altair, members) for members in _groups(rows)]
    if not panels:
        raise FreepathError(
            "the result has no case that was measured, so there is no picture of it"
        )
    title = altair.TitleParams(
        "What accuracy costs in time",
        subtitle=[device, "a dot: one sample; a curve that turns level has met its bias"],
        anchor="start",
        fontSize=18,
    )
    return (
        altair.concat(*panels, columns=columns)
        .properties(title=title, background="white")
        .configure_view(stroke="#ccc")
        .configure_legend(labelLimit=240, symbolSize=100, symbolStrokeWidth=2)
    )


def _groups(rows: list[Row]) -> list[list[Row]]:
    found: dict[tuple, list[Row]] = {}
    for row in rows:
        if row["status"] == "ok" and number(row, "reference"):
            found.setdefault(group_key(row), []).append(row)
    return list(found.values())


def _panel(altair: Any, rows: list[Row]) -> Any:
    axis = {"format": "~e", "tickCount": 6}
    base = altair.Chart(altair.InlineData(values=records(rows)), width=400, height=300).encode(
        x=altair.X("time_s:Q").scale(type="log").axis(title="device time a ray [s]", **axis),
        y=altair.Y("error:Q")
        .scale(type="log", domain=[DEEPEST, HIGHEST], clamp=True)
        .axis(title="relative RMSE", **axis),
        color=altair.Color("tracker:N").scale(scheme="category10"),
    )
    lines = base.mark_line(strokeWidth=2).encode(strokeDash="majorant:N")
    one_sample = base.mark_point(filled=True, size=50, opacity=1).transform_filter("datum.first")
    return (lines + one_sample).properties(title=f"{rows[0]['estimand']}, {rows[0]['medium']}")


def write(result: Path, output: Path) -> Path:
    """Draw the result's chart into a .svg or .png; raises FreepathError where that cannot be."""
    if output.suffix.lower() not in FORMATS:
        expected = " or ".join(FORMATS)
        raise FreepathError(f"{output}: expected a name that ends in {expected}")
    summary = result / SUMMARY
    if not summary.is_file():
        raise FreepathError(f"{result}: expected the folder of a run, with {SUMMARY} in it")
    picture = chart(read_rows(summary))
    try:
        picture.save(output, scale_factor=2.0)
    except OSError as error:
        raise FreepathError(f"cannot write {output}: {error.strerror}") from error
    return output
