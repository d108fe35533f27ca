"""A report as Markdown, as tables of LaTeX, and as small tables for a terminal."""

from __future__ import annotations

import math
import re
from typing import Any

from rich.markup import escape
from rich.table import Table

from freepath.show.answers import (
    digits,
    leading,
    percent,
    ratio,
    sentence,
    times_as_fast,
)
from freepath.show.markdown import table_of as table_lines
from freepath.show.markdown import text_of
from freepath.show.report.data import LADDER, Report, answered, known_to, late
from freepath.show.table import FAILED, marked, seconds, short, soonest

ACCURACIES = dict(zip(LADDER, (0.1, 0.01, 0.001), strict=True))
TARGETS = dict(zip(LADDER, ("to 10 %", "to 1 %", "to 0.1 %"), strict=True))
HEADER = ("case", "device", "lookups", "time", "occ.", "rel. var.", "bias (RMS)", *TARGETS.values())


def winners(report: Report) -> list[list[str]]:
    """For each question and device: what is the fastest to each accuracy, and when."""
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in report.measured:
        found.setdefault((row["q"], row["device"]), []).append(row)
    lines = []
    for (question, device), rows in found.items():
        cells = [question, device]
        for name in TARGETS:
            cells.append(_winner([row for row in rows if isinstance(row[name], float)], name))
        lines.append(cells)
    return lines


def _winner(reaching: list[dict[str, Any]], name: str) -> str:
    places = soonest([(row[name], known_to(row, name)) for row in reaching])
    if not places:
        return "not known" if reaching else "none"
    best, others = reaching[places[0]], len(places) - 1
    also = f" (not significantly slower: {others} more)" if others else ""
    return f"{_time(best, name)}, {best['method']}{also}"


def answers(report: Report, baseline: str = "") -> list[dict[str, Any]]:
    """For each question and device: a card for each accuracy, and what is at stake.

    That is how many times as fast the fastest case with lookups is as the baseline: a closed form
    is there only where nobody needs a tracker. Records get `xb`, their ratio to the baseline.
    """
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in report.rows:
        found.setdefault((row["q"], row["device"]), []).append(row)
    lines = []
    for (question, device), rows in found.items():
        failed = sum(row["status"] in FAILED for row in rows)
        cards, stake = {}, 0.0
        for name, accuracy in ACCURACIES.items():
            reached = [(one, row) for row in rows if (one := answered(row, name))]
            cases = [one for one, _ in reached]
            card = {"sentence": sentence(cases, accuracy, baseline, failed), "id": None}
            cards[name] = card
            known = leading(cases, baseline)
            if not known:
                continue
            (best, *close), base = known
            ids = {id(one): row["id"] for one, row in reached}
            card |= {
                "id": ids[id(best)],
                "base_id": ids[id(base)],
                "name": best.name,
                "time": marked(best.time_s, best.noise),
            }
            card["ratio"] = "" if best is base else times_as_fast(base, best)
            card |= {"base": base.name, "close": len(close)}
            card["bias"] = (
                f"biased by {percent(best.bias)}" if best.biased else "no measurable bias"
            )
            if name == "t1":
                for one, row in reached:
                    row["xb"] = digits(ratio(base, one)[0]) if one.settled else None
                timed = [one.time_s for one, row in reached if row["lookups"] and one.settled]
                stake = base.time_s / min(timed, default=math.inf)
        lines.append({"q": question, "device": device, "cards": cards, "stake": stake})
    return lines


def sentences(report: Report, baseline: str = "") -> list[str]:
    """The answer at 1 % to each question on each device."""
    several = len(report.values("device")) > 1
    lines = []
    for one in answers(report, baseline):
        told = f"{one['q']}, on {one['device']}" if several else one["q"]
        lines.append(f"{told}: {one['cards']['t1']['sentence']}")
    return lines


def summary(report: Report) -> Table:
    """The winners as a table for the terminal."""
    several = len(report.values("device")) > 1
    table = Table(title="fastest to an accuracy", title_justify="left", box=None)
    table.padding = (0, 1, 0, 0)
    table.add_column("question", overflow="fold")
    if several:
        table.add_column("device", overflow="fold")
    for name in TARGETS.values():
        table.add_column(name, overflow="fold")
    for question, device, *times in winners(report):
        table.add_row(*map(escape, [question, *([device] if several else []), *times]))
    return table


def _time(row: dict[str, Any], name: str) -> str:
    value = math.inf if row[name] == "never" else row[name]
    return marked(value, known_to(row, name))


def cells(row: dict[str, Any]) -> list[str]:
    """A case's row of the full table."""
    if row["v"] is None:
        return [row["method"], row["device"], *[""] * 4, row["status"], *[""] * len(TARGETS)]
    return [
        row["method"],
        row["device"],
        short(row["lookups"]),
        seconds(row["t"]),
        f"{100 * row['occupancy']:.0f}%",
        short(row["v"]),
        row["bias_told"],
        *(_time(row, name) for name in TARGETS),
    ]


def markdown(report: Report, baseline: str = "") -> str:
    """The whole report: answers, winners, all cases, and where it was measured."""
    lines = ["# What accuracy costs in time", ""]
    lines += [*(f"- {text_of(line)}" for line in sentences(report, baseline)), ""]
    lines += table_lines(["question", "device", *TARGETS.values()], winners(report))
    for question in report.values("q"):
        rows = [cells(row) for row in report.rows if row["q"] == question]
        lines += ["", f"## {text_of(question)}", ""]
        lines += table_lines(HEADER, rows)
    lines += ["", "## Environment", ""]
    facts = [[key, value] for run in report.runs for key, value in environment(run)]
    lines += table_lines(["", ""], facts)
    return "\n".join(lines) + "\n"


LATEX = {c: f"\\{c}" for c in "&%$#_{}"} | {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "<": r"\textless{}", ">": r"\textgreater{}", "±": r"$\pm$", "|": r"\textbar{}", "\n": " ",
}  # fmt: skip


def latex_of(text: str) -> str:
    """A text that LaTeX shows as it is, with a thin space before a unit."""
    shown = text.translate(str.maketrans(LATEX))
    return re.sub(r"(\d) (u?)(s|ms|ns|ps|\\%)$", _unit, shown)


def _unit(found: re.Match[str]) -> str:
    micro = r"$\mu$" if found[2] else ""
    return rf"{found[1]}\,{micro}{found[3]}"


def latex(report: Report, baseline: str = "") -> str:
    """A table of booktabs for each question, the fastest first, with its answer as caption."""
    told = dict(zip(report.values("q"), [""] * len(report.rows), strict=False))
    for one in answers(report, baseline):
        told[one["q"]] += f" {one['cards']['t1']['sentence']}"
    several = len(report.values("device")) > 1
    shown = [place for place, name in enumerate(HEADER) if several or name != "device"]
    lines = ["% needs \\usepackage{booktabs}"]
    for question, sentence_ in told.items():
        rows = [row for row in report.rows if row["q"] == question]
        texts = [HEADER, *(cells(row) for row in sorted(rows, key=late))]
        head, *body = (" & ".join(latex_of(row[p]) for p in shown) + r" \\" for row in texts)
        lines += [
            r"\begin{table}",
            rf"\caption{{{latex_of(question)}.{latex_of(sentence_)}}}",
            rf"\begin{{tabular}}{{{'l' * (1 + several)}{'r' * (len(shown) - 1 - several)}}}",
            r"\toprule", head, r"\midrule", *body, r"\bottomrule",
            r"\end{tabular}", r"\end{table}",
        ]  # fmt: skip
    return "\n".join(lines) + "\n"


def environment(run: dict[str, Any]) -> list[tuple[str, str]]:
    """What run.json tells of where a result was measured, as names and texts."""
    facts = [("result", run["name"])]
    config = run.get("config")
    if isinstance(config, dict):
        facts.append(("config", str(config.get("name", ""))))
    for session in dicts(run.get("sessions")):
        facts += [(name, str(session[name])) for name in ("started", "ended") if name in session]
        facts += _flat(session.get("host"))
    for device in dicts(run.get("devices")):
        facts += _flat(device, "device ")
    return facts


def dicts(value: Any) -> list[dict[str, Any]]:
    """Those of a list that are dictionaries: run.json may hold anything."""
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []


def _flat(value: Any, prefix: str = "") -> list[tuple[str, str]]:
    """The items of a dictionary, with those of dictionaries in it in its place."""
    if not isinstance(value, dict):
        return []
    found = []
    for key, one in value.items():
        found += _flat(one, prefix) if isinstance(one, dict) else [(f"{prefix}{key}", str(one))]
    return found
