"""The axes of a sweep, each once: what may be written, how it is named, shown and identified.

The matrix, entries of include and exclude, cases, their names, ids and rows are made from `AXES`.
What a new axis does is said where it takes effect; here and in `columns` it is said what it is.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from freepath.config.base import Kind, OneOf
from freepath.config.lights import LIGHTS, Uniform
from freepath.config.models import MAJORANTS, MEDIA, Global
from freepath.config.quantity import CountOr, Number, NumberOr
from freepath.config.rules import Choice, OneOrMore, Rule

ESTIMANDS = ("transmittance", "free_path", "radiance", "path_length", "mean_extinction")
ALONG_PATHS = ("radiance", "path_length")
"""Estimands of paths that scatter."""
UNLIMITED = "unlimited"
AUTO, ANALOG = "auto", "analog"
"""Of p_absorb: none of bounded paths and roulette of others; what the albedo leaves."""
# the word under which the models of the trackers are handed to a validation as its context
TRACKER = "tracker"
Point = dict[str, Any]
"""A value for each axis."""


@dataclass(frozen=True)
class Axis:
    """One axis; each value of it makes cases of its own."""

    name: str
    rule: Rule
    """What one value may be."""
    default: tuple[Any, ...] | None
    """Its values where a config has none; None where it must have some, () where it need not."""
    meaning: str
    usual: Any = ()
    """The value that names of cases do not mention."""
    later: bool = False
    """Whether the axis came later: its usual value is no part of identities, so they stay."""
    along_paths: bool = False
    """Whether it is of paths that scatter alone; its value is None elsewhere."""
    settled: Callable[[Any, Point], Any] = lambda value, point: value
    """One value for all that mean the same in a point, so that equal cases fall together."""
    prefix: str = ""
    """Before a number in the name of a case."""
    column: str = ""
    """Of summary.csv; by the axis' own name if left out."""
    absent: str | None = "none"
    """What the column says for None."""

    def values(self, *, pattern: bool = False, optional: bool = False) -> Any:
        """The annotation of values, of which one may stand for a list; for exclude patterns."""
        kinds = pattern and isinstance(self.rule, OneOf)
        rule = OneOf(self.rule.word, self.rule.models, pattern=True) if kinds else self.rule
        return Annotated[tuple[Annotated[Any, rule], ...], OneOrMore(optional=optional)]

    def part(self, value: Any) -> str:
        """What the name of a case says of a value; '' where it says nothing."""
        if value is None or value == self.usual:
            return ""
        named = "" if self.usual == () else f"{self.name}="
        return (self.prefix if value != AUTO else "") + named + short(value)

    def cell(self, value: Any) -> Any:
        """What the column says of a value."""
        return self.absent if value is None else label(value) if isinstance(value, Kind) else value


def short(value: Any) -> str:
    """A value in few letters; a kind by its label."""
    if isinstance(value, Kind):
        return label(value)
    if isinstance(value, tuple):
        if len(set(value)) == 1:
            return short(value[0])
        return "x".join(short(item) for item in value)
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    # a file is known by its name without folders; spaces and the like would need quoting in -R
    return re.sub(r"[^\w.+=-]", "_", re.split(r"[/\\]", str(value))[-1])


def label(kind: Kind) -> str:
    """Return a kind with what it must be given, then whatever else differs from its default.

    For instance "cloud-128-200" or "cloud-128-200-seed=2"; sigma_t needs no name either.
    """
    parts = [kind.kind]
    fields = type(kind).model_fields.items()
    for name, field in sorted(fields, key=lambda item: not item[1].is_required()):
        value = getattr(kind, name)
        if field.is_required():
            parts.append(short(value))
        elif value != field.default:
            parts.append(short(value) if name == "sigma_t" else f"{name}={short(value)}")
    return "-".join(parts)


def _if_bounded(value: Any, point: Point) -> Any:
    flown = filter(None, (point["tracker"], point["shadow"]))
    return value if any("majorant" in kind.NEEDS for kind in flown) else None


def _if_lit(value: Any, point: Point) -> Any:
    lit = "position" in type(point["light"]).model_fields
    return value if lit or point["effects"] == "all" else None


def _if_scattering(value: Any, point: Point) -> Any:
    return value if any(point["medium"].albedo) and point["scatterings"] != 0 else AUTO


def _if_voxels(value: Any, point: Point) -> Any:
    return value if point["medium"].VOXELS else "float"


def settle(point: Point) -> None:
    """Set what says nothing in a point to one value."""
    along = point["estimand"] in ALONG_PATHS
    # from the last one on: whether a majorant is needed is known once the shadow is
    for name, axis in reversed(AXES.items()):
        left_out = axis.along_paths and not along
        point[name] = None if left_out else axis.settled(point[name], point)


def name_of(point: Point) -> str:
    """The name of a case: what it is of, and last how it is run."""
    names = [name for name in AXES if name not in LAST] + list(LAST)
    return "/".join(filter(None, (AXES[name].part(point[name]) for name in names)))


LAST = ("tracker", "lanes", "arithmetic")
"""The axes that end the name of a case."""
_LIST = (
    Axis("estimand", Choice(ESTIMANDS), ("transmittance",), "What a case estimates."),
    Axis("medium", OneOf("medium", MEDIA), None, "What the rays pass through."),
    Axis(
        "majorant",
        OneOf("majorant", MAJORANTS),
        (Global(),),
        "Upper bounds of the extinction; trackers that need none ignore this axis.",
        settled=_if_bounded,
    ),
    Axis(
        "tightness",
        Number(above=0),
        (1.0,),
        "Factor on the majorant: 1 is tight, below 1 it no longer bounds.",
        settled=_if_bounded,
        prefix="t",
        absent=None,
    ),
    Axis(
        "tracker", OneOf(TRACKER), None, "How distances are sampled or transmittance is estimated."
    ),
    Axis(
        "light",
        OneOf("light", LIGHTS),
        (Uniform(),),
        "What shines on the medium, of radiance.",
        along_paths=True,
    ),
    Axis(
        "scatterings",
        CountOr(UNLIMITED),
        (UNLIMITED,),
        "How often a path may scatter, of radiance; unlimited ends it by Russian roulette.",
        along_paths=True,
        prefix="s",
    ),
    Axis(
        "p_absorb",
        NumberOr(Number("fraction", minimum=0, below=1), (AUTO, ANALOG)),
        (AUTO,),
        "The chance that a path is absorbed at a collision, of radiance: analog is\n"
        "1 - albedo; auto is 0 for bounded scatterings, and else Russian roulette by weight.",
        usual=AUTO,
        later=True,
        along_paths=True,
        settled=_if_scattering,
    ),
    Axis(
        "shadow",
        OneOf(TRACKER),
        (),
        "The tracker that estimates the transmittance towards a point light; ratio if left out.",
        along_paths=True,
        settled=_if_lit,
    ),
    Axis(
        "effects",
        Choice((AUTO, "all")),
        (AUTO,),
        "auto compiles what the scene has; all compiles everything, for comparison.",
        usual=AUTO,
        along_paths=True,
        column="composition",
        absent=AUTO,
    ),
    Axis(
        "lanes",
        Choice((AUTO, 1, 2, 4, 8, 16)),
        (AUTO,),
        "Paths that a work-item follows at once; auto is the device's vector width.",
        prefix="l",
    ),
    Axis(
        "arithmetic",
        Choice(("strict", "fast", "double")),
        ("strict",),
        "strict float, fast (-cl-fast-relaxed-math) or double.",
    ),
    Axis(
        "storage",
        Choice(("float", "half")),
        ("float",),
        "How the voxels of a grid are stored: float or half; other media ignore this axis.",
        usual="float",
        later=True,
        settled=_if_voxels,
    ),
)
AXES = {axis.name: axis for axis in _LIST}
