"""Axes, colours and labels that the charts of a report share."""

from __future__ import annotations

import json
from typing import Any

import altair as alt

from freepath.show.report.data import DEEPEST, HIGHEST, Report, late

APART = {"labelSeparation": 8, "labelOverlap": "greedy", "tickCount": 4, "grid": False}
ROUND = (
    "indexof([1, 2, 5], round(datum.value / pow(10, floor(log(datum.value) / LN10 + 1e-9)))) < 0"
)
"""Of the ticks of an axis of few decades only these have labels."""
SI = "replace(format(datum.value, '.3~s'), '\u00b5', 'u')"
SECONDS = f"{ROUND} ? '' : replace({SI}, /([a-z]?)$/, ' $1s')"
PERCENT = f"{ROUND} ? '' : format(100 * datum.value, '.3~r') + ' %'"
NUMBER = f"{ROUND} ? '' : format(datum.value, '.3~r')"
MARKED = (0.1, 0.01, 0.001)
"""Relative errors at which charts have a line, as tables have columns of them."""
HEAD, TAIL = 18, 28
"""Letters of a device's name that a legend has room for; its end tells drivers apart."""
DASHES = [[1, 0], [6, 3], [2, 2], [10, 3, 2, 3], [10, 5], [6, 2, 2, 2, 2, 2]]
"""As far apart as dashes are; of more devices some share one."""
TIME, ERROR = "device time per ray", "relative RMSE"
INK = "#111111"
"""The page has its own ink in its place."""
GREY = "#9a9ea6"
HUES = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", INK]
"""Seven that all eyes tell apart (Okabe and Ito 2008); their yellow is too faint on white."""
NONE = "datum.label === 'null' ? 'none' : datum.label"
BELOW = alt.Legend(orient="bottom", columns=4, labelExpr=NONE)
DATA = alt.TooltipContent("data")


def log_x(field: str, title: str, notation: str = SECONDS, *, nice: bool = True) -> alt.X:
    """A logarithmic axis; one that is not `nice` ends where its lines do."""
    return alt.X(field).scale(type="log", nice=nice).axis(title=title, labelExpr=notation, **APART)


def log_y(field: str, title: str, notation: str = SECONDS) -> alt.Y:
    """A logarithmic axis."""
    return alt.Y(field).scale(type="log").axis(title=title, labelExpr=notation, **APART)


def error_axis() -> alt.Y:
    """Relative RMSE; what is beyond the axis is cut off, and `beyond` marks where."""
    decades = [HIGHEST, 1.0, *MARKED, DEEPEST]
    return (
        alt.Y("error:Q")
        .scale(type="log", domain=[DEEPEST, HIGHEST])
        .axis(title=ERROR, labelExpr=PERCENT, values=decades, grid=False)
    )


def rules() -> alt.Chart:
    """Lines at the errors that tables tell times to."""
    marks = alt.Chart(alt.InlineData(values=[{"error": one} for one in MARKED]))
    return marks.mark_rule(color="#888", strokeDash=[2, 3]).encode(y=error_axis())


def beyond(base: alt.Chart, time: str, error: float, shape: str) -> alt.Chart:
    """A mark for each case at the time, an expression, at which its curve crosses an axis's end."""
    there = "datum.crosses > 0 && datum.crosses <= datum.hi"
    return (
        base.transform_calculate(crosses=time, error=f"{error}")
        .transform_calculate(time=f"{there} ? datum.crosses : datum.hi")
        .mark_point(filled=True, shape=shape, tooltip=DATA)
        .encode(size=alt.condition(there, alt.value(60), alt.value(0)))
    )


def leaders(report: Report) -> list[str]:
    """Trackers, those with the best places among the times to 1 % of a question first."""
    best: dict[str, float] = {}
    for question in report.values("q"):
        known = [row for row in report.measured if row["q"] == question]
        order = dict.fromkeys(row["colour"] for row in sorted(known, key=late))
        for place, name in enumerate(order):
            best[name] = min(place, best.get(name, place))
    return sorted(best, key=best.__getitem__)


def led(rows: list[dict[str, Any]], names: list[str]) -> list[dict[str, Any]]:
    """Copies of a question's rows; the best of each of the first trackers has a label, `lead`."""
    first: dict[str, Any] = {}
    for row in sorted(rows, key=late):
        if row["colour"] in names[: len(HUES)]:
            first.setdefault(row["colour"], row["id"])
    return [row | {"lead": row["colour"] if row["id"] in first.values() else None} for row in rows]


def colour_of(report: Report) -> alt.Color:
    """A colour for seven trackers, the same in all charts; the others are grey."""
    names = leaders(report)
    colours = [*HUES, *[GREY] * len(names)][: len(names)]
    return alt.Color("colour:N").scale(domain=names, range=colours).title("tracker").legend(None)


def strength() -> dict[str, Any]:
    """How much a case is seen: what has a label most, what is not isolated least."""
    tests = [("datum.faded", 0.12), ("datum.lead", 1.0)]
    return {"condition": [{"test": test, "value": value} for test, value in tests], "value": 0.55}


def labels(report: Report, base: alt.Chart, x: Any, height: str, gap: str) -> alt.Chart:
    """Names at the ends of lines, none over another: each at least `gap` decades above the last.

    `height` is an expression for log10 of where a line ends.
    """
    up = [alt.SortField("up")]
    return (
        base.transform_calculate(up=height)
        .transform_window(place="row_number()", sort=up)
        .transform_calculate(low=f"datum.up - {gap} * datum.place")
        .transform_window(low="max(low)", sort=up, frame=[None, 0])
        .transform_calculate(error=f"pow(10, datum.low + {gap} * datum.place)")
        .mark_text(align="left", dx=9, fontSize=11, limit=150, cursor="pointer")
        .encode(x=x, y=alt.Y("error:Q"), text="lead:N", color=colour_of(report))
    )


def hover_of() -> alt.Parameter:
    """The case that the pointer is at."""
    return alt.selection_point(
        name="hover", on="pointerover", fields=["id"], empty=False, clear="pointerout"
    )


def dash_of(report: Report) -> alt.StrokeDash:
    """Devices by the dashes of their lines where there are several, the same in all charts.

    Else majorants, which points tell by `shape_of` where there are several devices.
    """
    names = devices_of(report)
    if len(names) < 2:
        legend = None if len({row["bound"] for row in report.measured}) < 2 else BELOW
        return alt.StrokeDash("bound:N").title("majorant").legend(legend)
    return alt.StrokeDash("device:N").scale(domain=names, range=DASHES).legend(below(report))


def shape_of(report: Report, field: str = "x") -> alt.Shape:
    """Tightness by the shapes of points, with the majorants where dashes are of devices."""
    if len(devices_of(report)) > 1:
        field = "majorant" if field == "x" else "bound"
    elif field == "bound":
        return alt.ShapeValue("circle")
    some = len({row[field] for row in report.measured} - {None}) > 1
    title = "tightness" if field == "x" else "majorant"
    return alt.Shape(f"{field}:N").title(title).legend(BELOW if some else None)


def below(report: Report) -> alt.Legend:
    """A legend of devices; of names that are too long the middle is left out."""
    names = devices_of(report)
    cut = {n: f"{n[:HEAD]}...{n[-TAIL:]}" if len(n) > HEAD + TAIL + 3 else n for n in names}
    if len(set(cut.values())) < len(cut):
        cut = dict(zip(names, names, strict=True))
    told = f"({json.dumps(cut)})[datum.label]"
    return alt.Legend(
        orient="bottom", direction="vertical", columns=1, labelLimit=320, labelExpr=told
    )


def devices_of(report: Report) -> list[str]:
    """The devices of cases that were measured, in the order they come in."""
    return list(dict.fromkeys(row["device"] for row in report.measured))
