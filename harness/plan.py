"""From a config to its cases: the product of the axes, named, identified and told what to skip."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
import math
import re
from collections import Counter
from collections.abc import Mapping
from typing import Any

from freepath.applicable import skip_reason
from freepath.catalog import Catalog
from freepath.config.base import Kind
from freepath.config.sweep import AUTO, AXES, Config, Exclude, Include, Stop
from freepath.errors import ConfigError, NothingMatchedError, Problem
from freepath.path_axes import refuse_elsewhere, settle

MOST_CASES = 100_000
ID_LENGTH = 12
SHADOW = "ratio"
"""The tracker of shadow rays that a config need not name."""


@dataclasses.dataclass(frozen=True)
class Case:
    """One combination: what is measured, and with what.

    `majorant` and `tightness` are None for a tracker that uses no majorant. `params` are complete.
    `skip_reason` says why the combination cannot work; it is '' for one that can.
    `index` counts from 1. `sigma_t` and lengths are in the config's units (see config.quantity).
    """

    index: int
    name: str
    estimand: str
    medium: Kind
    majorant: Kind | None
    tightness: float | None
    tracker: str
    params: Mapping[str, float | int | str] = dataclasses.field(hash=False)
    lanes: int | str
    arithmetic: str
    storage: str
    """How the voxels of a grid are stored; float of media that have none."""
    rays: Kind
    seed: int
    stop: Stop
    skip_reason: str
    light: Kind | None = None
    scatterings: int | str | None = None
    p_absorb: float | str | None = None
    shadow: Kind | None = None
    effects: str | None = None
    """These five are of paths that scatter, None for other estimands; `shadow` is None without a
    point light."""

    def identity(self) -> dict[str, Any]:
        """Return everything that defines the case but its place and the device, fit for JSON."""
        paths = {} if self.light is None else self._of_paths()
        # what was always float is known by the same identity as when there was nothing else
        stored = {} if self.storage == "float" else {"storage": self.storage}
        return {
            **paths,
            **stored,
            "estimand": self.estimand,
            "medium": self.medium.as_dict(),
            "majorant": self.majorant.as_dict() if self.majorant else None,
            "tightness": self.tightness,
            "tracker": {self.tracker: dict(self.params)},
            "lanes": self.lanes,
            "arithmetic": self.arithmetic,
            "rays": self.rays.as_dict(),
            "seed": self.seed,
            "stop": self.stop.model_dump(mode="json"),
        }

    def _of_paths(self) -> dict[str, Any]:
        # as with storage
        absorbed = {} if self.p_absorb == AUTO else {"p_absorb": self.p_absorb}
        return {
            **absorbed,
            "light": self.light.as_dict(),
            "scatterings": self.scatterings,
            "shadow": self.shadow.as_dict() if self.shadow else None,
            "effects": self.effects,
        }

    @property
    def config_sha256(self) -> str:
        """The hash of all of `identity`."""
        return _sha256(self.identity())

    @property
    def case_id(self) -> str:
        """12 hexadecimal digits for what is measured, however long: `identity` without `stop`.

        So a longer run of a case is compared with a shorter one, but does not count as done.
        """
        identity = self.identity()
        del identity["stop"]
        return _sha256(identity)[:ID_LENGTH]


def _sha256(values: dict[str, Any]) -> str:
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def expand(config: Config, catalog: Catalog) -> list[Case]:
    """Return the cases of a config, each once, in the order of the axes.

    First the matrix, less what exclude entries match, then what include entries add. The config's
    trackers must be the catalog's. Raises ConfigError for an exclude entry that matches nothing
    (unless axes are overridden), for too many cases and for p_absorb
    where no path is followed, NothingMatchedError if none is left.
    """
    matrix = {axis: getattr(config.matrix, axis) for axis in AXES}
    if not matrix["shadow"]:
        default = catalog.trackers.get(SHADOW)
        matrix["shadow"] = (default.model() if default else None,)
    _refuse_too_many(config, matrix)
    refuse_elsewhere(config)
    points = _excluded(config, _points(matrix, catalog))
    for entry in config.include:
        points |= _points({**matrix, **_included_axes(entry, config)}, catalog)
    if not points:
        raise NothingMatchedError("no case: exclude removes every case of the matrix")
    cases = [_case(i, point, config, catalog) for i, point in enumerate(points.values(), 1)]
    return _named_apart(cases)


def _refuse_too_many(config: Config, matrix: dict[str, tuple[Any, ...]]) -> None:
    sizes = [math.prod(len(values) for values in matrix.values())]
    for entry in config.include:
        axes = {**matrix, **_included_axes(entry, config)}
        sizes.append(math.prod(len(values) for values in axes.values()))
    if sum(sizes) > MOST_CASES:
        message = f"expected at most {MOST_CASES} cases, got {sum(sizes)}"
        raise ConfigError([config.problem(("matrix",), message)])


def _included_axes(entry: Include, config: Config) -> dict[str, tuple[Any, ...]]:
    # an override means "only these values", also where an entry names others
    return {axis: values for axis, values in entry.axes().items() if axis not in config.overridden}


Point = dict[str, Any]


def _points(axes: dict[str, tuple[Any, ...]], catalog: Catalog) -> dict[tuple[Any, ...], Point]:
    """Return the product of the axes, keyed so that equal points fall together."""
    points = {}
    for values in itertools.product(*(axes[axis] for axis in AXES)):
        point = dict(zip(AXES, values, strict=True))
        settle(point)
        trackers = [kind for kind in (point["tracker"], point["shadow"]) if kind]
        if not any("majorant" in catalog.trackers[kind.kind].needs for kind in trackers):
            point["majorant"] = point["tightness"] = None
        if not point["medium"].VOXELS:
            point["storage"] = "float"
        points[tuple(point.values())] = point
    return points


def _excluded(config: Config, points: dict[tuple[Any, ...], Point]) -> dict[Any, Point]:
    """Return the points that no exclude entry matches."""
    removed: set[Any] = set()
    problems: list[Problem] = []
    for i, entry in enumerate(config.exclude):
        matched = {key for key, point in points.items() if _matches(entry, point)}
        if not matched and not config.overridden:
            message = "expected an entry that matches a case of the matrix, got one that does not"
            problems.append(config.problem(("exclude", i), message))
        removed |= matched
    if problems:
        raise ConfigError(problems)
    return {key: point for key, point in points.items() if key not in removed}


def _matches(entry: Exclude, point: Point) -> bool:
    return all(
        any(_equals(point[axis], value) for value in values)
        for axis, values in entry.axes().items()
    )


def _equals(value: Any, wanted: Any) -> bool:
    if isinstance(value, Kind) and isinstance(wanted, Kind):
        return value.matches(wanted)
    return value == wanted


def _case(index: int, point: Point, config: Config, catalog: Catalog) -> Case:
    tracker = catalog.trackers[point["tracker"].kind]
    return Case(
        index=index,
        name=_name(point),
        tracker=tracker.name,
        params=point["tracker"].parameters(),
        rays=config.rays,
        seed=config.seed,
        stop=config.stop,
        skip_reason=skip_reason(tracker, point, catalog),
        **{axis: point[axis] for axis in AXES if axis != "tracker"},
    )


def _name(point: Point) -> str:
    parts = [point["estimand"], label(point["medium"])]
    if point["majorant"]:
        parts += [label(point["majorant"]), f"t{_short(point['tightness'])}"]
    if point["light"]:
        parts += [label(point["light"]), f"s{point['scatterings']}"]
        absorbed = point["p_absorb"]
        parts += [] if absorbed == AUTO else [f"p_absorb={_short(absorbed)}"]
        parts += [label(point["shadow"])] if point["shadow"] else []
        parts += ["effects=all"] if point["effects"] == "all" else []
    parts += [] if point["storage"] == "float" else [f"storage={point['storage']}"]
    lanes = point["lanes"]
    parts += [label(point["tracker"]), lanes if lanes == "auto" else f"l{lanes}"]
    return "/".join([*parts, point["arithmetic"]])


def label(kind: Kind) -> str:
    """Return a kind with what it must be given, then whatever else differs from its default.

    For instance "cloud-128-200" or "cloud-128-200-seed=2"; sigma_t needs no name either.
    """
    parts = [kind.kind]
    fields = type(kind).model_fields.items()
    for name, field in sorted(fields, key=lambda item: not item[1].is_required()):
        value = getattr(kind, name)
        if field.is_required():
            parts.append(_short(value))
        elif value != field.default:
            parts.append(_short(value) if name == "sigma_t" else f"{name}={_short(value)}")
    return "-".join(parts)


def _short(value: Any) -> str:
    if isinstance(value, tuple):
        if len(set(value)) == 1:
            return _short(value[0])
        return "x".join(_short(item) for item in value)
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    # a file is known by its name without folders; spaces and the like would need quoting in -R
    return re.sub(r"[^\w.+=-]", "_", re.split(r"[/\\]", str(value))[-1])


def _named_apart(cases: list[Case]) -> list[Case]:
    """Add the id to names that several cases have, such as files of one name in two folders."""
    counts = Counter(case.name for case in cases)
    return [
        dataclasses.replace(case, name=f"{case.name}~{case.case_id}")
        if counts[case.name] > 1
        else case
        for case in cases
    ]


def select(cases: list[Case], include: str | None = None, exclude: str | None = None) -> list[Case]:
    """Return the cases whose name the first regular expression finds, and the second does not.

    Raises ConfigError for an invalid expression and NothingMatchedError if no case is left.
    """
    patterns = _compiled({"-R": include, "-E": exclude})
    selected = [
        case
        for case in cases
        if ("-R" not in patterns or patterns["-R"].search(case.name))
        and not ("-E" in patterns and patterns["-E"].search(case.name))
    ]
    if not selected:
        raise NothingMatchedError(f"no case: the filters match none of {len(cases)}")
    return selected


def _compiled(expressions: dict[str, str | None]) -> dict[str, re.Pattern[str]]:
    patterns: dict[str, re.Pattern[str]] = {}
    problems: list[Problem] = []
    for flag, expression in expressions.items():
        if expression is None:
            continue
        try:
            patterns[flag] = re.compile(expression)
        except (re.error, RecursionError, OverflowError) as error:
            message = f"expected a regular expression: {error}"
            problems.append(Problem(f"{flag} {expression}", 0, 0, "", message))
    if problems:
        raise ConfigError(problems)
    return patterns
