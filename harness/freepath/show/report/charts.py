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
    BELOW,
    DATA,
    HUES,
    INK,
    NUMBER,
    PERCENT,
    SECONDS,
    TIME,
    below,
    beyond,
    colour_of,
    dash_of,
    devices_of,
    error_axis,
    hover_of,
    labels,
    log_x,
    log_y,
    rules,
    shape_of,
    strength,
)
from freepath.show.report.data import DEEPEST, HIGHEST, Report
from freepath.show.table import UNSETTLED

POINTS = 32
RMSE = "sqrt(pow(datum.b, 2) + datum.v * datum.t / datum.time)"
"""freepath.measure.ladder, for a record of a page."""


FLOORED = "datum.b < {0} ? max(datum.t, datum.v * datum.t / ({0} * {0} - datum.b * datum.b)) : 0"
"""The time from which a case's error is below {0}; 0 if it never is."""


def cost(report: Report) -> alt.LayerChart:
    """RMSE over time of each case; a band shows the interval of the one that is pointed at."""
    hover = hover_of()
    noise = "0.5 * datum.v * datum.t / datum.time / pow(datum.error, 2)"
    width = f"{noise} * sqrt(pow(datum.vn || 0, 2) + pow(datum.tn || 0, 2))"
    rows = alt.Chart(alt.NamedData("rows"))
    colour, x = colour_of(report), log_x("time:Q", TIME, nice=False)
    pointed = alt.when(hover).then(alt.value(INK)).otherwise(colour)
    encoded = {"x": x, "y": error_axis(), "color": pointed, "detail": "id:N"}
    base = (
        rows.transform_calculate(grid=f"sequence(0, {POINTS + 1})")
        .transform_flatten(["grid"])
        .transform_calculate(time=f"datum.t * pow(datum.hi / datum.t, datum.grid / {POINTS})")
        .transform_calculate(error=f"max({RMSE}, 1e-12)")
        .transform_calculate(width=width)
    )
    lines = base.mark_line(clip=True).encode(
        **encoded,
        strokeDash=dash_of(report),
        opacity=strength(),
        strokeWidth={
            "condition": [
                {"param": "hover", "empty": False, "value": 4},
                {"test": "datum.lead", "value": 2.2},
            ],
            "value": 1.3,
        },
    )
    near = (
        base.mark_point(filled=True, clip=True, tooltip=DATA)
        .encode(
            **encoded,
            shape=shape_of(report),
            opacity=alt.condition("datum.grid == 0 && !datum.faded", alt.value(1), alt.value(0)),
            size=alt.condition("datum.grid == 0", alt.value(50), alt.value(150)),
        )
        .add_params(hover)
    )
    band = (
        base.transform_calculate(
            error="datum.error * max(1e-3, 1 - datum.width)",
            top="datum.error * (1 + datum.width)",
        )
        .mark_area(clip=True)
        .encode(
            **encoded | {"color": colour},
            y2="top:Q",
            opacity=alt.condition(hover, alt.value(0.25), alt.value(0)),
        )
    )
    start = "(datum.v + datum.b * datum.b > {0} * {0} ? ({1} || datum.t) : 0)"
    above = start.format(HIGHEST, f"({FLOORED.format(HIGHEST)})")
    ends = [
        beyond(rows, FLOORED.format(DEEPEST), DEEPEST, "triangle-down"),
        beyond(rows, above, HIGHEST, "triangle-up"),
    ]
    ends = [one.encode(**encoded | {"color": colour}, opacity=strength()) for one in ends]
    last = RMSE.replace("datum.time", "datum.hi")
    named = labels(
        report,
        rows.transform_filter("datum.lead"),
        "hi:Q",
        f"log(clamp({last}, {DEEPEST}, {HIGHEST})) / LN10",
        "0.23",
    )
    return alt.layer(rules(), band, lines, near, *ends, named)


def pareto(report: Report) -> alt.LayerChart:
    """The least RMSE that any case has after a time, and which case that is; a line a device.

    Of cases whose variance is known; an error below the axis is a mark where the line leaves it.
    """
    base = (
        alt.Chart(alt.NamedData("rows"))
        .transform_filter(f"isValid(datum.vn) && datum.vn <= {UNSETTLED}")
        .transform_calculate(grid=f"sequence(0, {2 * POINTS + 1})")
        .transform_flatten(["grid"])
        .transform_calculate(time=f"datum.lo * pow(datum.hi / datum.lo, datum.grid / {2 * POINTS})")
        .transform_filter("datum.time >= datum.t * 0.999999")
        .transform_calculate(error=f"max(1e-12, {RMSE})")
        .transform_joinaggregate(best="min(error)", groupby=["grid", "device"])
        .transform_filter("datum.error <= datum.best * 1.000001")
        .transform_joinaggregate(first="min(t)", groupby=["grid", "device"])
        .transform_filter("datum.t <= datum.first")
        .encode(x=log_x("time:Q", TIME, nice=False), y=error_axis())
    )
    lines = base.mark_line(color="#888", strokeWidth=1.5, clip=True)
    if len(devices_of(report)) > 1:
        lines = lines.encode(strokeDash=dash_of(report))
    points = base.mark_point(filled=True, size=60, opacity=1, clip=True, tooltip=DATA).encode(
        color=colour_of(report), shape=alt.Shape("device:N").legend(None)
    )
    floor = (
        base.transform_filter(f"datum.error < {DEEPEST}")
        .transform_joinaggregate(leaves="min(time)", groupby=["device"])
        .transform_filter("datum.time <= datum.leaves")
        .transform_calculate(error=f"{DEEPEST}")
        .mark_point(filled=True, size=90, shape="triangle-down", tooltip=DATA, opacity=1)
        .encode(color=colour_of(report))
    )
    changes = [
        part.transform_window(before="lag(label)", groupby=["device"], sort=[alt.SortField("time")])
        .transform_filter("datum.label != datum.before")
        .mark_text(align="left", dx=7, dy=-9, fontSize=11, limit=150, cursor="pointer")
        .encode(text="colour:N", color=colour_of(report))
        for part in (base.transform_filter(f"datum.error >= {DEEPEST}"), floor)
    ]
    return alt.layer(rules(), lines, points, floor, *changes)


def _over_tightness(report: Report, field: str, title: str, notation: str) -> alt.LayerChart:
    line = ["label", "device", "bound"]
    base = alt.Chart(alt.NamedData("rows")).transform_filter(
        f"datum.x !== null && datum.{field} > 0"
    )
    encoded = base.encode(
        x=alt.X("x:Q").scale(type="log", nice=False).axis(title="tightness", format="~g", **APART),
        y=log_y(f"{field}:Q", title, notation),
        color=colour_of(report),
        detail=[f"{name}:N" for name in line],
        opacity=strength(),
    )
    lines = encoded.mark_line().encode(strokeDash=dash_of(report))
    points = encoded.mark_point(filled=True, size=36, tooltip=DATA)
    ends = (
        base.transform_joinaggregate(least=f"min({field})", most=f"max({field})")
        .transform_calculate(one="datum.lead ? 1 : 0")
        .transform_joinaggregate(leads="sum(one)", end="max(x)", groupby=line)
        .transform_filter("datum.leads && datum.x == datum.end")
        .transform_calculate(lead="datum.colour")
    )
    gap = "(0.05 * log(datum.most / datum.least) / LN10)"
    named = labels(report, ends, "x:Q", f"log(datum.{field}) / LN10", gap)
    return alt.layer(lines, points.encode(shape=shape_of(report, "bound")), named)


def tightness_time(report: Report) -> alt.LayerChart:
    """Variance x time over tightness."""
    return _over_tightness(report, "vt", "relative variance x time", SECONDS)


def tightness_lookups(report: Report) -> alt.LayerChart:
    """Variance x lookups over tightness."""
    return _over_tightness(report, "vl", "relative variance x lookups", NUMBER)


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
            y=log_y("best:Q", "relative variance x time"),
            color=colour_of(report).legend(),
            detail=["label:N", "device:N"],
        )
    )


def lookups(report: Report) -> alt.LayerChart:
    """Lookups are not time: one against the other."""
    base = (
        alt.Chart(alt.NamedData("rows"))
        .transform_filter("datum.lookups > 0")
        .encode(
            x=log_x("lookups:Q", "lookups per sample", NUMBER),
            y=log_y("t:Q", "time per sample"),
            color=colour_of(report),
            opacity=strength(),
        )
    )
    some = len({row["bound"] for row in report.measured}) > 1
    shape = alt.Shape("bound:N").title("majorant").legend(BELOW if some else None)
    named = base.transform_filter("datum.lead").encode(text="lead:N")
    return alt.layer(
        base.mark_point(filled=True, size=60, tooltip=DATA).encode(shape=shape),
        named.mark_text(align="left", dx=8, fontSize=11, limit=150, cursor="pointer"),
    )


def occupancy(report: Report) -> alt.Chart:
    """The share of lanes at work, by tracker."""
    return (
        alt.Chart(alt.NamedData("rows"))
        .mark_tick(thickness=3, size=12, tooltip=DATA)
        .encode(
            x=alt.X("occupancy:Q").scale(domain=[0, 1]).axis(title="lane occupancy", format="%"),
            y=alt.Y("colour:N").title(None).axis(labelLimit=150),
            color=colour_of(report),
        )
    )


def devices(report: Report) -> alt.Chart:
    """Devices side by side at equal accuracy: the time to a relative RMSE, by method."""
    return (
        alt.Chart(alt.NamedData("rows"))
        .transform_fold(["t10", "t1", "t01"], as_=["error", "seconds"])
        .transform_filter("isNumber(datum.seconds)")
        .transform_calculate(error="{t10: '10 %', t1: '1 %', t01: '0.1 %'}[datum.error]")
        .mark_point(filled=True, size=60, opacity=0.9, tooltip=DATA)
        .encode(
            x=log_x("seconds:Q", f"{TIME} to an RMSE"),
            y=alt.Y("method:N").title(None).axis(labelLimit=170),
            color=alt.Color("device:N").scale(range=HUES).legend(below(report)),
            shape=alt.Shape("error:N").scale(domain=["10 %", "1 %", "0.1 %"]).title("RMSE"),
        )
    )


def confirm(report: Report) -> alt.LayerChart:
    """Measured over predicted RMSE, with the interval of what was measured."""
    base = alt.Chart(alt.NamedData("confirmed")).encode(
        x=log_x("predicted:Q", "predicted relative RMSE", PERCENT)
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
    points = base.mark_point(filled=True, size=40, tooltip=DATA).encode(
        y=y,
        color=colour_of(report),
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
