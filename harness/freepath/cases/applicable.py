"""Which combinations of the axes cannot work, and why."""

from __future__ import annotations

from typing import Any

from freepath.compose.catalog import ANY, Catalog, Tracker

Point = dict[str, Any]


def skip_reason(tracker: Tracker, point: Point, catalog: Catalog) -> str:
    """Why a point of the matrix cannot work with its tracker; '' where it can."""
    return _flight_reason(tracker, point) or _path_reason(tracker, point, catalog)


def _flight_reason(tracker: Tracker, point: Point) -> str:
    """Why a tracker cannot fly through a medium."""
    reasons = []
    if point["estimand"] not in tracker.estimands:
        reasons.append(f"{tracker.name} does not estimate {point['estimand']}")
    majorant = point["majorant"]
    if majorant and majorant.kind not in tracker.majorants:
        reasons.append(f"{tracker.name} does not work with a majorant {majorant.kind}")
    channels = point["medium"].channel_count
    factors = set(point["medium"].channels or ())
    alike = point["light"] is not None and tracker.channels == 1 and factors <= {1.0}
    if tracker.channels not in (ANY, channels) and not alike:
        follows = f"{tracker.name} follows {_counted(tracker.channels)}"
        reasons.append(f"{follows}, and the medium has {channels}")
    for need in sorted(tracker.needs - {"majorant", "control", "light"} - point["medium"].OFFERS):
        what = need.replace("_", " ")
        reasons.append(f"{tracker.name} needs {what}, which {point['medium'].kind} does not offer")
    return "; ".join(reasons)


def _path_reason(tracker: Tracker, point: Point, catalog: Catalog) -> str:
    """Why a case of paths that scatter cannot work; '' where it can, and for other estimands."""
    light = point["light"]
    if light is None:
        return ""
    has_point = hasattr(light, "intensity")
    has_environment = hasattr(light, "radiance") or hasattr(light, "file")
    single = tracker.single_flight if isinstance(tracker.single_flight, dict) else {}
    given = point["tracker"].parameters()
    alone = [name for name, choices in single.items() if given[name] in choices]
    shadow = point["shadow"] and catalog.trackers[point["shadow"].kind]
    reasons = {
        f"{tracker.name} with this {''.join(alone)} is for single flights": bool(alone),
        f"{tracker.name} needs a point light": "light" in tracker.needs and not has_point,
        f"{tracker.name} needs a medium that scatters": "light" in tracker.needs
        and not (any(point["medium"].albedo) and point["scatterings"]),
        f"{tracker.name} never leaves the medium, and around it is light": not tracker.escapes
        and has_environment,
        "the rod model has no chance to scatter towards a point": shadow
        and point["medium"].phase == "rod",
    }
    if shadow:
        reason = _flight_reason(shadow, point | {"estimand": "transmittance"})
        reasons[f"shadow: {reason}"] = bool(reason)
        other_walk = "control" in shadow.needs ^ tracker.needs
        reasons[f"{tracker.name} and {shadow.name} of shadows need different walks"] = other_walk
        other = shadow.name == tracker.name and point["shadow"] != point["tracker"]
        reasons[f"{tracker.name} cannot have other parameters for shadows"] = other
    return "; ".join(reason for reason, holds in reasons.items() if holds)


def _counted(channels: int | str) -> str:
    return "one channel" if channels == 1 else f"{channels} channels"
