"""Axes, colours and tooltips that the charts of a report share."""

from __future__ import annotations

import altair as alt
from freepath.report.data import DEEPEST, HIGHEST, Report

APART = {"labelSeparation": 8, "labelOverlap": "greedy"}
SCIENTIFIC = {"format": "~e", "tickCount": 6} | APART
BELOW = alt.Legend(orient="bottom", direction="vertical", columns=1, labelLimit=320)
"""Names of devices are long."""
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


def dash_of() -> alt.StrokeDash:
    """Majorants by the dashes of their lines."""
    return alt.StrokeDash("bound:N").title("majorant")
