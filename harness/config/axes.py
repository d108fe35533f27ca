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
from freepath.config.rules import Choice, OneOrMore

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
    value: Any
    """The annotation of one value."""
    meaning: str
    default: tuple[Any, ...] | None
    """Its values where a config has none; None where it must have some, () where it need not."""
    pattern: Any = None
    """The annotation of a value in exclude, if that is another."""
    usual: Any = ()
    """The value that names of cases do not mention."""
    later: bool = False
    """Whether the axis came later: its usual value is no part of identities, so they stay."""
    along_paths: bool = False
    """Whether it is of paths that scatter alone; its value is None elsewhere."""
    settled: Callable[[Any, Point], Any] = lambda value, point: value
    """One value for all that mean the same in a point, so that equal cases fall together."""
    text: Callable[[Any], str] | None = None
    """A value in the name of a case."""
    column: str = ""
    """Of summary.csv; by the axis' own name if left out."""
    absent: str | None = "none"
    """What the column says for None."""

    def values(self, value: Any = None, *, optional: bool = False) -> Any:
        """The annotation of a list of values, or of one that stands for it."""
        return Annotated[tuple[value or self.value, ...], OneOrMore(optional=optional)]

    def part(self, value: Any) -> str:
        """What the name of a case says of a value; '' where it says nothing."""
        if value is None or value == self.usual:
            return ""
        if self.text:
            return self.text(value)
        return short(value) if self.usual == () else f"{self.name}={short(value)}"

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
Chance = NumberOr(Number("fraction", minimum=0, below=1), (AUTO, ANALOG))
Tracker = Annotated[Kind, OneOf(TRACKER)]
TrackerPattern = Annotated[Kind, OneOf(TRACKER, pattern=True)]


AXES = {
    axis.name: axis
    for axis in (
        Axis(
            "estimand",
            Annotated[str, Choice(ESTIMANDS)],
            "What a case estimates.",
            ("transmittance",),
        ),
        Axis(
            "medium",
            Annotated[Kind, OneOf("medium", MEDIA)],
            "What the rays pass through.",
            None,
            Annotated[Kind, OneOf("medium", MEDIA, pattern=True)],
        ),
        Axis(
            "majorant",
            Annotated[Kind, OneOf("majorant", MAJORANTS)],
            "Upper bounds of the extinction; trackers that need none ignore this axis.",
            (Global(),),
            Annotated[Kind, OneOf("majorant", MAJORANTS, pattern=True)],
            settled=_if_bounded,
        ),
        Axis(
            "tightness",
            Annotated[float, Number(above=0)],
            "Factor on the majorant: 1 is tight, below 1 it no longer bounds.",
            (1.0,),
            settled=_if_bounded,
            text=lambda value: f"t{short(value)}",
            absent=None,
        ),
        Axis(
            "tracker",
            Tracker,
            "How distances are sampled or transmittance is estimated.",
            None,
            TrackerPattern,
        ),
        Axis(
            "light",
            Annotated[Kind, OneOf("light", LIGHTS)],
            "What shines on the medium, of radiance.",
            (Uniform(),),
            Annotated[Kind, OneOf("light", LIGHTS, pattern=True)],
            along_paths=True,
        ),
        Axis(
            "scatterings",
            Annotated[int | str, CountOr(UNLIMITED)],
            "How often a path may scatter, of radiance; unlimited ends it by Russian roulette.",
            (UNLIMITED,),
            along_paths=True,
            text=lambda value: f"s{value}",
        ),
        Axis(
            "p_absorb",
            Annotated[float | str, Chance],
            "The chance that a path is absorbed at a collision, of radiance: analog is\n"
            "1 - albedo; auto is 0 for bounded scatterings, and else Russian roulette by weight.",
            (AUTO,),
            usual=AUTO,
            later=True,
            along_paths=True,
            settled=_if_scattering,
        ),
        Axis(
            "shadow",
            Tracker,
            "The tracker that estimates the transmittance towards a point light; "
            "ratio if left out.",
            (),
            TrackerPattern,
            along_paths=True,
            settled=_if_lit,
        ),
        Axis(
            "effects",
            Annotated[str, Choice(("auto", "all"))],
            "auto compiles what the scene has; all compiles everything, for comparison.",
            ("auto",),
            usual="auto",
            along_paths=True,
            column="composition",
            absent="auto",
        ),
        Axis(
            "lanes",
            Annotated[int | str, Choice(("auto", 1, 2, 4, 8, 16))],
            "Paths that a work-item follows at once; auto is the device's vector width.",
            ("auto",),
            text=lambda value: value if value == "auto" else f"l{value}",
        ),
        Axis(
            "arithmetic",
            Annotated[str, Choice(("strict", "fast", "double"))],
            "strict float, fast (-cl-fast-relaxed-math) or double.",
            ("strict",),
        ),
        Axis(
            "storage",
            Annotated[str, Choice(("float", "half"))],
            "How the voxels of a grid are stored: float or half; other media ignore this axis.",
            ("float",),
            usual="float",
            later=True,
            settled=_if_voxels,
        ),
    )
}
