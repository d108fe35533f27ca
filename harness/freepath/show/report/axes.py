"""Axes, colours and tooltips that the charts of a report share."""

from __future__ import annotations

import json

import altair as alt

from freepath.show.report.data import DEEPEST, HIGHEST, Report

APART = {"labelSeparation": 8, "labelOverlap": "greedy"}
SCIENTIFIC = {"format": "~e", "tickCount": 6} | APART
HEAD, TAIL = 18, 28
"""Letters of a device's name that a legend has room for; its end tells drivers apart."""
DASHES = [[1, 0], [6, 3], [2, 2], [10, 3, 2, 3], [10, 5], [6, 2, 2, 2, 2, 2]]
"""As far apart as dashes are; of more devices some share one."""
TIME, ERROR = "device time a ray [s]", "relative RMSE"
CASE = [
    alt.Tooltip("method:N", title="case"),
    alt.Tooltip("device:N"),
]
COSTS = [
    alt.Tooltip("t:Q", title="time a sample [s]", format=".3~e"),
    alt.Tooltip("lookups:Q", title="lookups a sample", format=".3~g"),
    alt.Tooltip("v:Q", title="relative variance", format=".3~e"),
    alt.Tooltip("occupancy:Q", title="lane occupancy", format=".0%"),
]


def log_x(field: str, title: str) -> alt.X:
    """A logarithmic axis."""
    return alt.X(field).scale(type="log").axis(title=title, **SCIENTIFIC)


def log_y(field: str, title: str) -> alt.Y:
    """A logarithmic axis."""
    return alt.Y(field).scale(type="log").axis(title=title, **SCIENTIFIC)


def error_axis() -> alt.Y:
    """Relative RMSE; what is below the axis is drawn at its end."""
    return (
        alt.Y("error:Q")
        .scale(type="log", domain=[DEEPEST, HIGHEST], clamp=True)
        .axis(title=ERROR, **SCIENTIFIC)
    )


def colour_of(report: Report) -> alt.Color:
    """One colour a tracker, the same in all charts."""
    names = list(dict.fromkeys(row["colour"] for row in report.measured))
    scheme = "tableau10" if len(names) <= 10 else "tableau20"
    colour = alt.Color("colour:N").scale(scheme=scheme, domain=names).title("tracker")
    return colour.legend(symbolOpacity=1)  # else as faint as the points between which curves run


def hover_of() -> alt.Parameter:
    """The case that the pointer is at."""
    # not `nearest`: Vega-Lite's tooltip then has no names, only numbers
    return alt.selection_point(
        name="hover", on="pointerover", fields=["id"], empty=False, clear="pointerout"
    )


def dash_of(report: Report) -> alt.StrokeDash:
    """Devices by the dashes of their lines where there are several, the same in all charts.

    Else majorants, which points tell by `shape_of` where there are several devices.
    """
    names = devices_of(report)
    if len(names) < 2:
        return alt.StrokeDash("bound:N").title("majorant")
    return alt.StrokeDash("device:N").scale(domain=names, range=DASHES).legend(below(report))


def shape_of(report: Report) -> alt.Shape | alt.ShapeValue:
    """Majorants by the shapes of points, where dashes are of devices."""
    if len(devices_of(report)) < 2:
        return alt.ShapeValue("circle")
    return alt.Shape("bound:N").title("majorant")


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
