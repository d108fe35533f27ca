"""What `freepath list` and `freepath devices` show, as text or as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from freepath import config
from freepath.compose.catalog import Catalog, Parameter
from freepath.config.document import Document
from freepath.config.loading import read_text
from freepath.config.models import MAJORANTS, MEDIA

if TYPE_CHECKING:
    from freepath.device.drivers import Driver
    from freepath.device.opencl import DeviceInfo
    from freepath.device.trial import Outcome

Record = dict[str, Any]

EFFECTS = {
    "absorption": "every medium takes light out of the ray",
    "heterogeneous": "the extinction varies: a lookup at each tentative collision",
    "emission": "the medium emits: collected where a path is absorbed",
    "environment": "light from outside: collected where a path leaves",
    "environment_image": "light from outside as an image has it: looked up where a path leaves",
    "scattering": "a path goes on in a new direction, as the medium's phase says",
    "roulette": "scatterings without limit: a path of little weight may end",
    "p_absorb": "a path is absorbed at a collision with a chosen chance, and weighted for it",
    "point_light": "a shadow ray at each scattering, with a tracker of its own",
    "length": "the length of paths instead of what they collect",
    "chromatic": "a weight for each channel: one lookup and one path serve all",
    "majorant_grid": "a majorant for each cell: a walk by DDA between tentative collisions",
}


def trackers(catalog: Catalog) -> list[Record]:
    """One record a tracker."""
    return [
        {
            "tracker": tracker.name,
            "title": tracker.title,
            "estimands": ", ".join(tracker.estimands),
            "needs": ", ".join(sorted(tracker.needs)) or "nothing",
            "channels": tracker.channels,
            "majorant must bound": _bounding(tracker.bounding),
            "unbiased": tracker.unbiased,
            "parameters": [_parameter(*item) for item in tracker.parameters.items()],
            "citation": tracker.citation,
        }
        for tracker in catalog.trackers.values()
    ]


def _bounding(value: bool | dict[str, tuple[Any, ...]]) -> bool | str:
    """Whether the majorant must bound, or for which choices."""
    if isinstance(value, bool):
        return value
    return "; ".join(f"{name}: {', '.join(map(str, given))}" for name, given in value.items())


def _parameter(name: str, given: Parameter) -> str:
    """A parameter with its default, its unit and bounds or its choices, and its meaning."""
    rule = given.rule().describe()
    return f"{name} = {_plain(given.default)}: {given.meaning or name} ({rule})"


def kinds(models: dict[str, Any], word: str) -> list[Record]:
    """One record a kind of medium or majorant."""
    return [
        {
            word: name,
            "what": model.__doc__,
            "parameters": [_field(*item) for item in model.model_fields.items()],
        }
        for name, model in models.items()
    ]


def _field(name: str, field: Any) -> str:
    if field.is_required():
        return f"{name} (required): {field.description}"
    given = "(optional)" if field.default is None else f"= {_plain(field.default)}"
    return f"{name} {given}: {field.description}"


def _plain(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_plain, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def configs() -> list[Record]:
    """One record a shipped config."""
    records = []
    for name, path in config.shipped().items():
        keys = Document.parse(str(path), read_text(path)).data
        records.append({"config": name, "what": keys.get("description"), "file": str(path)})
    return records


def devices(driver: Driver, outcome: Outcome, *, is_default: bool) -> list[Record]:
    """One record a device of a driver."""
    first = next(iter(outcome.working), None)
    return [
        {
            "device": info.name,
            "-d": driver.name,
            "works": f"no: {why}; {UNUSABLE}" if why else True,
            "default": "the first that works here" if is_default and info is first else None,
            "platform": info.platform,
            "driver": info.driver_version,
            "kind": info.kind,
            "compute units": info.compute_units,
            "lanes": info.lanes,
            "double": info.fp64,
            "timer resolution [ns]": round(info.timer_resolution_s * 1e9),
            "timing source": info.timing_source,
            "remarks": remarks(info),
        }
        for info, why in zip(outcome.devices, outcome.failures, strict=True)
    ]


UNUSABLE = "use another driver, or update this one"


def remarks(info: DeviceInfo) -> list[str]:
    """What is to be known of a device beside its numbers."""
    found = []
    if info.interpreted:
        found.append("interprets kernels and checks every access: few rays, few samples")
    if info.loop_limit:
        found.append(f"ends the loops of a work-item after {info.loop_limit} rounds")
    return found


def not_there(driver: Driver, missing: str) -> Record:
    """The record of a driver without a device."""
    return {"device": driver.title, "-d": driver.name, "missing": missing}


def records_of(what: str, catalog: Catalog) -> list[Record]:
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


def table_of(records: list[Record]) -> Table:
    """Each record's first value, and beside it the others, a line each with its key."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(overflow="fold", max_width=28, style="bold")
    table.add_column(overflow="fold")
    for record in records:
        (_, name), *rest = record.items()
        lines = [line for key, value in rest for line in _lines(key, value)]
        table.add_row(escape(name), escape("\n".join(lines)))
    return table


def _lines(key: str, value: Any) -> list[str]:
    if isinstance(value, list):
        return [f"  {line}" for line in value]
    if value is None or value == "":
        return []
    if isinstance(value, bool):
        value = "yes" if value else "no"
    return [str(value) if key in ("title", "what", "file", "citation") else f"{key}: {value}"]
