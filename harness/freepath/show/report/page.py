"""The page: one HTML file with its styles, scripts, charts and rows in it; it loads nothing."""

from __future__ import annotations

import contextlib
import hashlib
import html
import json
import os
import re
from collections import Counter
from importlib import resources
from pathlib import Path
from typing import Any

from freepath import __version__
from freepath.results.columns import OF_SUMMARY
from freepath.results.folder import write
from freepath.show.report.charts import ACROSS, CHARTS, useful
from freepath.show.report.data import Report
from freepath.show.report.renders import panels
from freepath.show.report.text import answers, dicts, environment

FIELDS = (
    "id", "q", "device", "case", "label", "tracker", "majorant", "bound", "method", "x", "lanes",
    "arithmetic", "storage", "status", "reason", "t", "lookups", "occupancy", "tn", "vn",
    "v", "b", "bias", "vt", "vl", "t10", "t1", "t01", "rough", "unknown", "lo", "hi",
    "colour", "xb", "bias_told",
)  # fmt: skip
"""What of a record goes into the page."""


TERMS = {
    "lookups": "lookups_per_sample",
    "t": "time_per_sample_s",
    "occupancy": "lane_occupancy",
    "v": "variance",
    "bias": "bias",
    "t10": "time_to_10pct_s",
    "t1": "time_to_1pct_s",
    "t01": "time_to_0.1pct_s",
} | {name: name for name in ("lanes", "arithmetic", "storage", "status")}
"""Fields of the table, with the columns of summary.csv whose meanings explain them."""
MORE = {
    "v": "; over the squared reference",
    "bias": ", with its 95 % interval; in brackets the RMS over rays, which decides",
}


def page(report: Report, baseline: str = "") -> str:
    """The page of a report; its `left_out` then names what the page could not show."""
    told = sorted(answers(report, baseline), key=lambda one: -one["stake"])
    renders, report.left_out = panels(report)
    shown = {
        name: {"title": CHARTS[name][1], "spec": _specification(report, name)}
        for name in useful(report)
        if name not in ACROSS
    }
    data = {
        "fields": FIELDS,
        "rows": [[_rounded(row.get(name)) for name in FIELDS] for row in report.rows],
        "answers": told,
        "terms": _terms(),
        "confirmed": report.confirmed,
        "charts": shown,
        "renders": renders,
    }
    title = f"freepath: {', '.join(run['name'] for run in report.runs)}"
    parts = {
        "@TITLE@": html.escape(title),
        "@STYLE@": _asset("page.css"),
        "@UNFINISHED@": _unfinished(report),
        "@CHECKS@": "".join(_checks(run) for run in report.runs if run["checks"]),
        "@LEFTOUT@": _left_out(report.left_out),
        "@ENVIRONMENT@": "".join(map(_environment, report.runs)),
        "@VERSION@": html.escape(__version__),
        "@DATA@": _embedded(data),
        "@SCRIPT@": _asset("page.js"),
        "@LIBRARY@": _library(),
    }
    text = _asset("page.html")
    for mark, part in parts.items():
        before, _, after = text.partition(mark)
        text = before + part + after
    return text


def _specification(report: Report, name: str) -> dict[str, Any]:
    """A chart without rows: the page hands it those that are chosen."""
    size = {} if name in ("occupancy", "devices") else {"height": 340}
    chart = CHARTS[name][0](report).properties(width="container", **size)
    specification = chart.to_dict()
    specification.pop("config", None)
    return specification


def _rounded(value: Any) -> Any:
    """Seven digits: more are nobody's to see, and double the page."""
    return float(f"{value:.7g}") if isinstance(value, float) else value


def _embedded(data: Any) -> str:
    """JSON that no name in it can end the script of."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _environment(run: dict[str, Any]) -> str:
    items = (f"<dt>{html.escape(k)}</dt><dd>{html.escape(v)}</dd>" for k, v in environment(run))
    return f"<dl>{''.join(items)}</dl>"


def _checks(run: dict[str, Any]) -> str:
    """What became of the checks of a tracker on trial: how many passed, and each by name."""
    checks = run["checks"]
    count = Counter(str(one["status"]) for one in checks)
    wrong = [one for one in checks if one["status"] not in ("Passed", "Skipped")]
    told = f"{count['Passed']} checks passed, {len(wrong)} failed, {count['Skipped']} do not apply"
    rows = "".join(
        "<dt>{}</dt><dd>{}</dd>".format(
            *(html.escape(str(text)) for text in (one["name"], one["text"] or one["status"]))
        )
        for one in wrong + [one for one in checks if one not in wrong]
    )
    return (
        f"<section><h2>Is it right?</h2><p>{told}.</p>"
        f"<details><summary>Checks</summary><dl>{rows}</dl></details></section>"
    )


def _terms() -> dict[str, str]:
    """What headers of the table mean, by their fields; without the marks of Markdown."""
    meanings = {
        field: re.sub(r"\[([^]]*)\]\([^)]*\)|`", r"\1", OF_SUMMARY[column].meaning)
        for field, column in TERMS.items()
    }
    return {field: f"{meaning}{MORE.get(field, '')}" for field, meaning in meanings.items()}


def _unfinished(report: Report) -> str:
    """What runs had not ended when the page was made, and how far they were."""
    told = []
    for run, (_, records) in zip(report.runs, report.places, strict=True):
        last = next(iter(dicts(run.get("sessions"))[-1:]), {})
        ended, total = last.get("ended", "complete"), len(dicts(run.get("cases")))
        if ended != "complete":
            told.append(
                f"{run['name']}: the run is not complete ({ended}); {len(records)} of {total} "
                "cases are here, and what comes last, such as pictures, may be missing"
            )
    lines = "".join(f"<p>{html.escape(one)}.</p>" for one in told)
    return f'<aside id="unfinished" role="status">{lines}</aside>' if told else ""


def _left_out(told: list[str]) -> str:
    """Which pictures are not shown, and why."""
    if not told:
        return ""
    items = "".join(f"<li>{html.escape(one)}</li>" for one in told)
    title = "<h2>Pictures that are left out</h2>"
    return f'<section>{title}<ul id="left-out">{items}</ul></section>'


def _asset(name: str) -> str:
    return (resources.files("freepath.show.report") / name).read_text("utf-8")


def _library() -> str:
    """Vega, Vega-Lite and Vega-Embed in one script; kept behind its hash: it takes long to make."""
    import vl_convert

    folder = os.environ.get("FREEPATH_CACHE")
    if not folder:
        import platformdirs

        folder = platformdirs.user_cache_dir("freepath")
    path = Path(folder) / f"vega-{vl_convert.__version__}.sealed"
    with contextlib.suppress(OSError, UnicodeDecodeError):
        seal, _, text = path.read_text("utf-8").partition("\n")
        if seal == hashlib.sha256(text.encode()).hexdigest():
            return text
    text = vl_convert.javascript_bundle().replace("</script", "<\\/script")
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write(path, f"{hashlib.sha256(text.encode()).hexdigest()}\n{text}")
    return text
