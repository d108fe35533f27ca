"""The charts of a report, in Altair. Each takes named data, so that a page can hand it some rows.

Curves are computed within the chart from a case's time, variance and bias:
RMSE(t)^2 = bias^2 + variance x time_per_sample / t.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import altair as alt

from freepath.show.report.axes import (
    APART,
    CASE,
    COSTS,
    ERROR,
    TIME,
    below,
    colour_of,
    dash_of,
    devices_of,
    error_axis,
    hover_of,
    log_x,
    log_y,
    shape_of,
)
from freepath.show.report.data import DEEPEST, Report
from freepath.show.table import UNSETTLED

POINTS = 32
RMSE = "sqrt(pow(datum.b, 2) + datum.v * datum.t / datum.time)"
"""freepath.measure.ladder, for a record of a page."""


def cost(report: Report) -> alt.LayerChart:
    """RMSE over time of each case; a band shows the interval of the one that is pointed at."""
    hover = hover_of()
    noise = "0.5 * datum.v * datum.t / datum.time / pow(datum.error, 2)"
    width = f"{noise} * sqrt(pow(datum.vn || 0, 2) + pow(datum.tn || 0, 2))"
    base = (
        alt.Chart(alt.NamedData("rows"))
        .transform_calculate(grid=f"sequence(0, {POINTS + 1})")
        .transform_flatten(["grid"])
        .transform_calculate(time=f"datum.t * pow(datum.hi / datum.t, datum.grid / {POINTS})")
        .transform_calculate(error=RMSE)
        .transform_calculate(
            error=f"max(datum.error, {DEEPEST})",
            width=width,
            samples="datum.time / datum.t",
        )
        .encode(x=log_x("time:Q", TIME), detail="id:N")
    )
    lines = base.mark_line().encode(
        y=error_axis(),
        color=colour_of(report),
        strokeDash=dash_of(report),
        strokeWidth=alt.condition(hover, alt.value(4), alt.value(1.6)),
    )
    near = (
        base.mark_point(filled=True)
        .encode(
            y=error_axis(),
            color=colour_of(report),
            shape=shape_of(report),
            opacity=alt.condition("datum.grid == 0", alt.value(1), alt.value(0)),
            size=alt.condition("datum.grid == 0", alt.value(36), alt.value(150)),
            tooltip=[
                *CASE,
                alt.Tooltip("time:Q", title=TIME, format=".3~e"),
                alt.Tooltip("error:Q", title=ERROR, format=".3~e"),
                alt.Tooltip("width:Q", title="+- (95 %), of it", format=".2~%"),
                alt.Tooltip("samples:Q", title="samples", format=".3~s"),
                *COSTS,
            ],
        )
        .add_params(hover)
    )
    band = (
        base.transform_calculate(
            error=f"max({DEEPEST}, datum.error * (1 - datum.width))",
            top="datum.error * (1 + datum.width)",
        )
        .mark_area(clip=True)
        .encode(
            y=error_axis(),
            y2="top:Q",
            color=colour_of(report),
            opacity=alt.condition(hover, alt.value(0.25), alt.value(0)),
        )
    )
    return band + lines + near


def pareto(report: Report) -> alt.LayerChart:
    """The least RMSE that any case has after a time, and which case that is; a line a device.

    Of cases whose variance is known.
    """
    base = (
        alt.Chart(alt.NamedData("rows"))
        .transform_filter(f"isValid(datum.vn) && datum.vn <= {UNSETTLED}")
        .transform_calculate(grid=f"sequence(0, {2 * POINTS + 1})")
        .transform_flatten(["grid"])
        .transform_calculate(time=f"datum.lo * pow(datum.hi / datum.lo, datum.grid / {2 * POINTS})")
        .transform_filter("datum.time >= datum.t * 0.999999")
        .transform_calculate(error=f"max({DEEPEST}, {RMSE})")
        .transform_joinaggregate(best="min(error)", groupby=["grid", "device"])
        .transform_filter("datum.error <= datum.best * 1.000001")
        .transform_joinaggregate(first="min(t)", groupby=["grid", "device"])
        .transform_filter("datum.t <= datum.first")
        .encode(x=log_x("time:Q", TIME), y=error_axis())
    )
    lines = base.mark_line(color="#888", strokeWidth=1.5)
    if len(devices_of(report)) > 1:
        lines = lines.encode(strokeDash=dash_of(report))
    points = base.mark_point(filled=True, size=60, opacity=1).encode(
        color=colour_of(report),
        shape=alt.Shape("device:N").legend(None),
        tooltip=[
            *CASE,
            alt.Tooltip("time:Q", title=TIME, format=".3~e"),
            alt.Tooltip("error:Q", title=ERROR, format=".3~e"),
        ],
    )
    return lines + points


def _over_tightness(report: Report, field: str, title: str) -> alt.LayerChart:
    base = (
        alt.Chart(alt.NamedData("rows"))
        .transform_filter(f"datum.x !== null && datum.{field} > 0")
        .encode(
            x=alt.X("x:Q").scale(type="log").axis(title="tightness", format="~g", **APART),
            y=log_y(f"{field}:Q", title),
            color=colour_of(report),
            detail=["label:N", "device:N", "bound:N"],
        )
    )
    lines = base.mark_line().encode(strokeDash=dash_of(report))
    points = base.mark_point(filled=True, size=36)
    return lines + points.encode(shape=shape_of(report), tooltip=[*CASE, *COSTS])


def tightness_time(report: Report) -> alt.LayerChart:
    """Variance x time over tightness."""
    return _over_tightness(report, "vt", "relative variance x time [s]")


def tightness_lookups(report: Report) -> alt.LayerChart:
    """Variance x lookups over tightness."""
    return _over_tightness(report, "vl", "relative variance x lookups")


def lights(report: Report) -> alt.Chart:
    """Variance x time over lights, by the numbers in their names; of majorants the best."""
    names = {row["light"] for row in report.measured if row["light"]}
    order = sorted(names, key=lambda name: list(map(float, re.findall(r"\d+\.?\d*", name))))
    return (
        alt.Chart(alt.NamedData("rows"))
        .transform_filter("datum.light !== null && datum.vt > 0")
        .transform_aggregate(best="min(vt)", groupby=["light", "label", "colour", "device"])
        .mark_line(point=True)
        .encode(
            x=alt.X("light:N").sort(order).axis(title="light", labelLimit=160, labelAngle=-25),
            y=log_y("best:Q", "relative variance x time [s]"),
            color=colour_of(report),
            detail=["label:N", "device:N"],
            tooltip=["label:N", "light:N", alt.Tooltip("best:Q", format=".3~e")],
        )
    )


def lookups(report: Report) -> alt.Chart:
    """Lookups are not time: one against the other."""
    return (
        alt.Chart(alt.NamedData("rows"))
        .transform_filter("datum.lookups > 0")
        .mark_point(filled=True, size=60)
        .encode(
            x=log_x("lookups:Q", "lookups a sample"),
            y=log_y("t:Q", "time a sample [s]"),
            color=colour_of(report),
            shape=alt.Shape("bound:N").title("majorant"),
            tooltip=[*CASE, *COSTS],
        )
    )


def occupancy(report: Report) -> alt.Chart:
    """The share of lanes at work, by tracker."""
    return (
        alt.Chart(alt.NamedData("rows"))
        .mark_tick(thickness=3, size=12)
        .encode(
            x=alt.X("occupancy:Q").scale(domain=[0, 1]).axis(title="lane occupancy", format="%"),
            y=alt.Y("colour:N").title(None).axis(labelLimit=150),
            color=colour_of(report).legend(None),
            tooltip=[*CASE, *COSTS],
        )
    )


def devices(report: Report) -> alt.Chart:
    """Devices side by side at equal accuracy: the time to a relative RMSE, by method."""
    return (
        alt.Chart(alt.NamedData("rows"))
        .transform_fold(["t10", "t1", "t01"], as_=["error", "seconds"])
        .transform_filter("isNumber(datum.seconds)")
        .transform_calculate(error="{t10: '10 %', t1: '1 %', t01: '0.1 %'}[datum.error]")
        .mark_point(filled=True, size=60, opacity=0.9)
        .encode(
            x=log_x("seconds:Q", f"{TIME} until the RMSE is as given"),
            y=alt.Y("method:N").title(None).axis(labelLimit=170),
            color=alt.Color("device:N").scale(scheme="set1").legend(below(report)),
            shape=alt.Shape("error:N").scale(domain=["10 %", "1 %", "0.1 %"]).title("RMSE"),
            tooltip=[
                *CASE,
                alt.Tooltip("error:N", title="RMSE"),
                alt.Tooltip("seconds:Q", title="after [s]", format=".3~e"),
            ],
        )
    )


def confirm(report: Report) -> alt.LayerChart:
    """Measured over predicted RMSE, with the interval of what was measured."""
    base = alt.Chart(alt.NamedData("confirmed")).encode(
        x=log_x("predicted:Q", "predicted relative RMSE")
    )
    near = alt.Scale(domain=[0.5, 1.5], clamp=True)
    y = alt.Y("ratio:Q", scale=near, title="measured / predicted")
    marks = alt.Chart(alt.NamedData("confirmed")).mark_rule(color="#888", strokeDash=[4, 3])
    rules = [marks.encode(y=alt.datum(value, scale=near)) for value in (0.9, 1.0, 1.1)]
    intervals = base.mark_rule(opacity=0.5, clip=True).encode(
        y=alt.Y("low:Q", scale=near),
        y2="high:Q",
        color=colour_of(report),
    )
    points = base.mark_point(filled=True, size=40).encode(
        y=y,
        color=colour_of(report),
        tooltip=[
            *CASE,
            alt.Tooltip("samples:Q", title="samples a ray"),
            alt.Tooltip("predicted:Q", format=".3~e"),
            alt.Tooltip("ratio:Q", title="measured / predicted", format=".3f"),
        ],
    )
    return alt.layer(*rules, intervals, points)


CHARTS: dict[str, tuple[Callable[[Report], Any], str]] = {
    "cost": (cost, "What accuracy costs in time"),
    "pareto": (pareto, "The best after each time, and which case it is"),
    "tightness-time": (tightness_time, "Variance x time over tightness"),
    "tightness-lookups": (tightness_lookups, "Variance x lookups over tightness"),
    "lights": (lights, "Variance x time over the lights"),
    "lookups": (lookups, "Lookups are not time"),
    "occupancy": (occupancy, "Lanes at work"),
    "devices": (devices, "Devices at equal accuracy"),
    "confirm": (confirm, "Predicted errors, measured"),
}
"""Charts by the names that --chart takes, with their titles."""
ACROSS = frozenset({"lights"})
"""Charts across the questions of a scene: pictures, for a page shows one question at a time."""


def useful(report: Report) -> list[str]:
    """The charts that the rows of a report have something to show in."""
    rows = report.measured
    shown = dict.fromkeys(CHARTS, bool(rows))
    if len({row["x"] for row in rows if row["x"] is not None}) < 2:
        shown["tightness-time"] = shown["tightness-lookups"] = False
    shown["lights"] = len({row["light"] for row in rows if row["light"]}) > 1
    shown["devices"] = len({row["device"] for row in rows}) > 1
    shown["confirm"] = bool(report.confirmed)
    shown["lookups"] = any(row["lookups"] for row in rows)
    return [name for name, show in shown.items() if show]
