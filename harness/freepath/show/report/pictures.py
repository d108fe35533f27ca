"""Charts as pictures for papers: a panel for each question that the cases answer."""

from __future__ import annotations

import warnings
from typing import Any

from freepath.errors import FreepathError, did_you_mean
from freepath.show.report.data import Report, late

MOST = 80
"""Cases that a panel shows, those that reach 1 % soonest: of more, none could be told apart."""


def picture(report: Report, name: str, columns: int = 2) -> Any:
    """Return a chart by its name, as an altair chart with its data in it."""
    import altair

    from freepath.show.report.axes import leaders, led
    from freepath.show.report.charts import ACROSS, CHARTS, useful

    if name not in CHARTS:
        hint = did_you_mean(name, CHARTS)
        raise FreepathError(f"--chart: expected one of {', '.join(CHARTS)}, got '{name}'{hint}")
    if name not in useful(report):
        raise FreepathError(f"the result has nothing that the chart '{name}' could show")
    altair.data_transformers.disable_max_rows()
    make, title = CHARTS[name]
    source = report.confirmed if name == "confirm" else report.measured
    panels = []
    panel_of = "scene" if name in ACROSS else "q"
    for question in dict.fromkeys(row[panel_of] for row in source):
        rows = [row for row in source if row[panel_of] == question]
        rows = rows if name in ACROSS else soonest(rows)
        rows = rows if name == "confirm" else led(rows, leaders(report))
        size = {"width": 400} if name in ("occupancy", "devices") else {"width": 400, "height": 300}
        chart = make(report).properties(title=question, **size)
        panels.append(_with_data(chart, altair.InlineData(values=rows)))
    subtitle = report.values("device")
    shown = altair.TitleParams(title, subtitle=subtitle, anchor="start", fontSize=18)
    return (
        altair.concat(*panels, columns=min(columns, len(panels)))
        .properties(title=shown, background="white")
        .configure_view(stroke="#ccc")
        .configure_legend(labelLimit=240, symbolSize=100, symbolStrokeWidth=2)
    )


def soonest(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """At most MOST rows, those that reach 1 % first; never and what is not known last."""
    return rows if len(rows) <= MOST or "t1" not in rows[0] else sorted(rows, key=late)[:MOST]


def _with_data(chart: Any, data: Any) -> Any:
    """Give a chart its rows, in all of its layers; parameters must differ between panels."""
    chart = chart.copy(deep=True)
    parts = getattr(chart, "layer", [])
    for part in parts:
        part.data = data
    chart.data = data
    return chart


def drawn(report: Report, name: str, kind: str) -> bytes:
    """A chart as `kind`, svg or png."""
    import vl_convert

    with warnings.catch_warnings():
        # parameters of panels have one name; a still picture has none of them
        warnings.filterwarnings("ignore", message="Automatically deduplicated")
        specification = _still(picture(report, name).to_dict())
    if kind == "png":
        return vl_convert.vegalite_to_png(specification, scale=2.0)
    return vl_convert.vegalite_to_svg(specification).encode()


def _still(part: Any) -> Any:
    """A specification without selections, which a picture has no use for.

    Conditions on them become what holds while nothing is pointed at.
    """
    if isinstance(part, list):
        return [_still(one) for one in part]
    if not isinstance(part, dict):
        return part
    part = {key: value for key, value in part.items() if key != "params"}
    if "condition" in part:
        found = part.pop("condition")
        kept = [one for one in (found if isinstance(found, list) else [found]) if "test" in one]
        part |= {"condition": kept} if kept else {}
    return {key: _still(value) for key, value in part.items()}
