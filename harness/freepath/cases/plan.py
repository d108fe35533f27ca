"""From a config to its cases: the product of the axes, with names, ids and reasons to skip."""

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

from freepath.cases.applicable import skip_reason
from freepath.compose.catalog import Catalog
from freepath.config.axes import AXES, Point, name_of, settle
from freepath.config.base import Kind
from freepath.config.path_axes import refuse_elsewhere
from freepath.config.sweep import Config, Exclude, Include, Stop
from freepath.errors import ConfigError, NothingMatchedError, Problem

MOST_CASES = 100_000
ID_LENGTH = 12
SHADOW = "ratio"
"""The tracker of shadow rays that a config need not name."""


@dataclasses.dataclass(frozen=True)
class Case:
    """One combination: what is measured, and with what. Each axis is an attribute of its name.

    `majorant` and `tightness` are None for a tracker that uses no majorant, the axes of paths that
    scatter for other estimands, `shadow` also without a point light. `sigma_t` and lengths are in
    the config's units (see config.quantity). `index` counts from 1.
    """

    index: int
    name: str
    point: Mapping[str, Any] = dataclasses.field(hash=False)
    """The value of each axis."""
    rays: Kind
    seed: int
    stop: Stop
    skip_reason: str
    """Why the combination cannot work; '' for one that can."""

    def __getattr__(self, axis: str) -> Any:
        try:
            return self.__dict__["point"][axis]
        except KeyError:
            raise AttributeError(axis) from None

    @property
    def tracker(self) -> str:
        """The name of the tracker."""
        return self.point["tracker"].kind

    @property
    def params(self) -> dict[str, float | int | str]:
        """All parameters of the tracker."""
        return self.point["tracker"].parameters()

    def identity(self) -> dict[str, Any]:
        """Return everything that defines the case but its place and the device, fit for JSON."""
        named = {}
        for name, axis in AXES.items():
            value = self.point[name]
            outside = axis.along_paths and self.light is None
            if not (outside or (axis.later and value == axis.usual)):
                named[name] = value.as_dict() if isinstance(value, Kind) else value
        return {
            **named,
            "rays": self.rays.as_dict(),
            "seed": self.seed,
            "stop": self.stop.model_dump(mode="json"),
        }

    @property
    def scene(self) -> str:
        """What cases share that are measured in turns: their medium."""
        return str(self.medium.as_dict())

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
    included = [matrix | _included_axes(entry, config) for entry in config.include]
    count = sum(math.prod(map(len, axes.values())) for axes in (matrix, *included))
    if count > MOST_CASES:
        message = f"expected at most {MOST_CASES} cases, got {count}"
        raise ConfigError([config.problem(("matrix",), message)])
    refuse_elsewhere(config)
    points = _excluded(config, _points(matrix))
    for axes in included:
        points |= _points(axes)
    if not points:
        raise NothingMatchedError("no case: exclude removes every case of the matrix")
    cases = []
    for index, point in enumerate(points.values(), 1):
        reason = skip_reason(catalog.trackers[point["tracker"].kind], point, catalog)
        run = config.rays, config.seed, config.stop
        cases.append(Case(index, name_of(point), point, *run, reason))
    return _named_apart(cases)


def _included_axes(entry: Include, config: Config) -> dict[str, tuple[Any, ...]]:
    # an override means "only these values", also where an entry names others
    return {axis: values for axis, values in entry.axes().items() if axis not in config.overridden}


def _points(axes: dict[str, tuple[Any, ...]]) -> dict[tuple[Any, ...], Point]:
    """Return the product of the axes, keyed so that equal points fall together."""
    points = {}
    for values in itertools.product(*(axes[axis] for axis in AXES)):
        point = dict(zip(AXES, values, strict=True))
        settle(point)
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


def shard(cases: list[Case], number: int, count: int) -> list[Case]:
    """Return the `number`-th of `count` parts of the cases, in their order; each is in one part.

    Cases of a scene are measured in turns, so scenes stay whole where there are as many as parts:
    the largest first, each goes to the part that has the fewest cases. Where there are fewer, each
    is cut into as equal parts as can be. Raises NothingMatchedError for a part without a case.
    """
    scenes: dict[str, list[Case]] = {}
    for case in cases:
        scenes.setdefault(case.scene, []).append(case)
    pieces = [(members, 1) for members in scenes.values()]
    while sum(cuts for _, cuts in pieces) < min(count, len(cases)):
        most = max(range(len(pieces)), key=lambda i: len(pieces[i][0]) / pieces[i][1])
        pieces[most] = (pieces[most][0], pieces[most][1] + 1)
    cut = [members[first::cuts] for members, cuts in pieces for first in range(cuts)]
    parts: list[list[Case]] = [[] for _ in range(count)]
    for piece in sorted(cut, key=len, reverse=True):
        min(parts, key=len).extend(piece)
    if not parts[number - 1]:
        raise NothingMatchedError(f"no case: part {number} of {count} is empty, of {len(cases)}")
    return sorted(parts[number - 1], key=lambda case: case.index)


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
