"""What `freepath list` and `freepath devices` show, as tables or as JSON."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from freepath import config
from freepath.catalog import Catalog, Parameter
from freepath.config.models import MAJORANTS, MEDIA

EFFECTS = {
    "absorption": "every medium takes light out of the ray",
    "heterogeneous": "the extinction varies: a lookup at each tentative collision",
    "majorant_grid": "a majorant for each cell: a walk by DDA between tentative collisions",
}


def trackers(catalog: Catalog) -> list[dict[str, Any]]:
    """One record a tracker."""
    return [
        {
            "tracker": tracker.name,
            "title": tracker.title,
            "estimands": ", ".join(tracker.estimands),
            "needs": ", ".join(sorted(tracker.needs)) or "nothing",
            "channels": tracker.channels,
            "majorant must bound": bounding(tracker.bounding),
            "unbiased": tracker.unbiased,
            "parameters": "\n".join(parameter(*item) for item in tracker.parameters.items()),
            "citation": tracker.citation,
        }
        for tracker in catalog.trackers.values()
    ]


def bounding(value: bool | dict[str, tuple]) -> bool | str:
    """Whether the majorant must bound, or for which choices."""
    if isinstance(value, bool):
        return value
    return "; ".join(f"{name}: {', '.join(map(str, given))}" for name, given in value.items())


def parameter(name: str, given: Parameter) -> str:
    """A parameter with its default, unit and bounds."""
    text = f"{name} = {given.default}" + (f" {given.unit}" if given.unit else "")
    if given.choices is not None:
        return f"{text} ({' | '.join(map(str, given.choices))})"
    signs = {"minimum": ">=", "above": ">", "maximum": "<=", "below": "<"}
    bounds = [f"{sign} {getattr(given, key):g}" for key, sign in signs.items()
              if getattr(given, key) is not None]
    return text + (f" ({', '.join(bounds)})" if bounds else "")


def kinds(models: dict[str, Any], word: str) -> list[dict[str, Any]]:
    """One record a kind of medium or majorant."""
    records = []
    for name, model in models.items():
        fields = [
            key if field.is_required() else f"{key} = {field.default}"
            for key, field in model.model_fields.items()
        ]
        records.append({word: name, "what": model.__doc__, "parameters": ", ".join(fields)})
    return records


def configs() -> list[dict[str, Any]]:
    """One record a shipped config."""
    return [{"config": name, "file": str(path)} for name, path in config.shipped().items()]


def records_of(what: str, catalog: Catalog) -> list[dict[str, Any]]:
    """The records of one of arguments.LISTS."""
    if what == "trackers":
        return trackers(catalog)
    if what == "media":
        return kinds(MEDIA, "medium")
    if what == "majorants":
        return kinds(MAJORANTS, "majorant")
    if what == "effects":
        return [{"effect": name, "what": text} for name, text in EFFECTS.items()]
    return configs()


def table_of(records: list[dict[str, Any]]) -> Table:
    """A table with a column a key."""
    table = Table()
    for key in records[0]:
        table.add_column(key, overflow="fold")
    for record in records:
        table.add_row(*(_cell(value) for value in record.values()))
    return table


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value).replace("[", r"\[")
