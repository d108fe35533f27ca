"""Charts as pictures for papers: a panel for each question that the cases answer."""

from __future__ import annotations

import re
import warnings
from typing import Any

from freepath.errors import FreepathError, did_you_mean
from freepath.show.report.data import Report, late

MOST = 80
"""Cases that a panel shows, those that reach 1 % soonest: of more, none could be told apart."""


SIZE = re.compile(r'width="([\d.]+)" height="([\d.]+)"')
BESIDE, NARROWEST = 150.0, 60.0
"""Pixels that axes and labels take beside a panel, about, and a panel at least."""
LOWEST = 220.0
"""Of its height: labels at the ends of lines stand apart then."""
STACKED = {"bottom": {"direction": "vertical", "anchor": "start"}}
"""Legends of a picture whose width is given: side by side they may be wider than that."""
SMALLEST = 0.6
"""Letters of 11 points are no smaller than so many times that."""
PPI = 300
"""Of a PNG whose width is given."""


def picture(report: Report, name: str, width: float | None = None, *, titled: bool = True) -> Any:
    """Return a chart by its name, as an altair chart with its data in it.

    `width` is that of a panel in pixels; then panels stand one below the other.
    """
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
        size = {"width": width or 400}
        if name not in ("occupancy", "devices"):
            size["height"] = max(LOWEST, 0.75 * size["width"])
        chart = make(report).properties(**size, **({"title": question} if titled else {}))
        panels.append(_with_data(chart, altair.InlineData(values=rows)))
    shown = {}
    if titled:
        devices = report.values("device")
        shown["title"] = altair.TitleParams(title, subtitle=devices, anchor="start", fontSize=18)
    return (
        altair.concat(*panels, columns=1 if width or len(panels) < 2 else 2)
        .properties(background="white", **shown)
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


def drawn(report: Report, choice: Any, kind: str) -> bytes:
    """A chart as `kind`: svg, png or pdf; `choice` is one of `writing`."""
    if choice.width_pt:
        return converted(as_wide(report, choice), kind, sized=True)
    return converted(_svg(report, choice), kind, sized=False)


def converted(svg: str, kind: str, *, sized: bool) -> bytes:
    """An SVG as `kind`; one that is `sized`, in points, has that size on paper."""
    import vl_convert

    if kind == "png":
        return vl_convert.svg_to_png(svg, ppi=PPI if sized else 144)
    if kind == "pdf":
        return vl_convert.svg_to_pdf(svg)  # which takes a pixel for a point
    return (SIZE.sub(r'width="\1pt" height="\2pt"', svg, count=1) if sized else svg).encode()


def _svg(report: Report, choice: Any, width: float | None = None) -> str:
    import vl_convert

    with warnings.catch_warnings():
        # parameters of panels have one name; a still picture has none of them
        warnings.filterwarnings("ignore", message="Automatically deduplicated")
        found = picture(report, choice.chart, width, titled=choice.titled).to_dict()
    if width:
        found["config"]["legend"]["layout"] = STACKED
    return vl_convert.vegalite_to_svg(_still(found))


def as_wide(report: Report, choice: Any) -> str:
    """A picture whose whole width is what is asked for, by its panels: letters keep their size.

    What axes and legends need beside a panel is known only of a picture, so it is drawn again.
    Letters shrink where these need more than there is; raises FreepathError for the unreadable.
    """
    wanted, width, found = choice.width_pt, max(NARROWEST, choice.width_pt - BESIDE), 0.0
    for _ in range(3):
        svg = _svg(report, choice, width)
        found, height = map(float, SIZE.search(svg).groups())
        if abs(found - wanted) <= 1 or (width <= NARROWEST and found > wanted):
            break
        width = max(NARROWEST, width + wanted - found)
    scale = wanted / found
    if scale < SMALLEST:
        least = f"{SMALLEST * found * 2.54 / 72:.2g} cm"
        raise FreepathError(f"--width: the chart '{choice.chart}' needs {least} at least")
    size = f'width="{wanted:.4f}" height="{height * scale:.4f}"'
    return SIZE.sub(size, svg, count=1)


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
