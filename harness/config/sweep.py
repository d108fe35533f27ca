"""A whole config: the matrix of axes, the entries that add and remove cases, when to stop."""

from pathlib import Path
from typing import Annotated, Any

from freepath.config.base import UNKNOWN_KEY, Kind, Model, OneOf
from freepath.config.document import Document, Location, path_text
from freepath.config.lights import LIGHTS, Uniform
from freepath.config.models import MAJORANTS, MEDIA, Fraction, Global, Seed
from freepath.config.quantity import CountOr, Number, NumberOr
from freepath.config.rays import RAYS, Orthographic
from freepath.config.rules import Choice, Flag, OneOrMore, Text, expected, failure
from freepath.errors import Problem
from pydantic import (
    ConfigDict,
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    ValidationError,
    ValidatorFunctionWrapHandler,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails

ESTIMANDS = ("transmittance", "free_path", "radiance", "path_length", "mean_extinction")
ALONG_PATHS = ("radiance", "path_length")
"""Estimands of paths that scatter; the axes light to effects are only theirs."""
UNLIMITED = "unlimited"
AUTO, ANALOG = "auto", "analog"
"""Of p_absorb: none of bounded paths and roulette of others; what the albedo leaves."""
LANES = ("auto", 1, 2, 4, 8, 16)
ARITHMETIC = ("strict", "fast", "double")
STORAGE = ("float", "half")
# the word under which the models of the trackers are handed to a validation as its context
TRACKER = "tracker"

NAME = Text("a name of letters, digits, '.', '_' and '-'", r"[A-Za-z0-9][A-Za-z0-9._-]*")

Estimands = Annotated[tuple[Annotated[str, Choice(ESTIMANDS)], ...], OneOrMore()]
Media = Annotated[tuple[Annotated[Kind, OneOf("medium", MEDIA)], ...], OneOrMore()]
Majorants = Annotated[tuple[Annotated[Kind, OneOf("majorant", MAJORANTS)], ...], OneOrMore()]
Tightnesses = Annotated[tuple[Annotated[float, Number(above=0)], ...], OneOrMore()]
Trackers = Annotated[tuple[Annotated[Kind, OneOf(TRACKER)], ...], OneOrMore()]
Lights = Annotated[tuple[Annotated[Kind, OneOf("light", LIGHTS)], ...], OneOrMore()]
Shadows = Annotated[tuple[Annotated[Kind, OneOf(TRACKER)], ...], OneOrMore(optional=True)]
Scatterings = Annotated[tuple[Annotated[int | str, CountOr(UNLIMITED)], ...], OneOrMore()]
Chance = NumberOr(Number("fraction", minimum=0, below=1), (AUTO, ANALOG))
Absorptions = Annotated[tuple[Annotated[float | str, Chance], ...], OneOrMore()]
Effects = Annotated[tuple[Annotated[str, Choice(("auto", "all"))], ...], OneOrMore()]
Lanes = Annotated[tuple[Annotated[int | str, Choice(LANES)], ...], OneOrMore()]
Arithmetics = Annotated[tuple[Annotated[str, Choice(ARITHMETIC)], ...], OneOrMore()]
Storages = Annotated[tuple[Annotated[str, Choice(STORAGE)], ...], OneOrMore()]

MediumPattern = Annotated[Kind, OneOf("medium", MEDIA, pattern=True)]
MajorantPattern = Annotated[Kind, OneOf("majorant", MAJORANTS, pattern=True)]
LightPattern = Annotated[Kind, OneOf("light", LIGHTS, pattern=True)]
TrackerPattern = Annotated[Kind, OneOf(TRACKER, pattern=True)]


class Matrix(Model):
    """Axes whose every combination is a case; one value is an axis of one."""

    estimand: Estimands = ("transmittance",)
    """What a case estimates."""
    medium: Media
    """What the rays pass through."""
    majorant: Majorants = (Global(),)
    """Upper bounds of the extinction; trackers that need none ignore this axis."""
    tightness: Tightnesses = (1.0,)
    """Factor on the majorant: 1 is tight, below 1 it no longer bounds."""
    tracker: Trackers
    """How distances are sampled or transmittance is estimated."""
    light: Lights = (Uniform(),)
    """What shines on the medium, of radiance."""
    scatterings: Scatterings = (UNLIMITED,)
    """How often a path may scatter, of radiance; unlimited ends it by Russian roulette."""
    p_absorb: Absorptions = (AUTO,)
    """The chance that a path is absorbed at a collision, of radiance: analog is
    1 - albedo; auto is 0 for bounded scatterings, and else Russian roulette by weight."""
    shadow: Shadows = ()
    """The tracker that estimates the transmittance towards a point light; ratio if left out."""
    effects: Effects = ("auto",)
    """auto compiles what the scene has; all compiles everything, for comparison."""
    lanes: Lanes = ("auto",)
    """Paths that a work-item follows at once; auto is the device's vector width."""
    arithmetic: Arithmetics = ("strict",)
    """strict float, fast (-cl-fast-relaxed-math) or double."""
    storage: Storages = ("float",)
    """How the voxels of a grid are stored: float or half; other media ignore this axis."""


AXES = tuple(Matrix.model_fields)


class Entry(Model):
    """Values for some of the axes."""

    @model_validator(mode="after")
    def _some(self) -> "Entry":
        if not self.model_fields_set:
            raise expected("at least one axis", {})
        return self

    @model_serializer(mode="wrap")
    def _as_written(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {name: value for name, value in handler(self).items() if value is not None}

    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Return the axes that the entry names and their values."""
        return {name: getattr(self, name) for name in AXES if name in self.model_fields_set}


class Include(Entry):
    """Cases to add: the product of these axes, and of the matrix's for those left out."""

    estimand: Estimands = Field(None)
    medium: Media = Field(None)
    majorant: Majorants = Field(None)
    tightness: Tightnesses = Field(None)
    tracker: Trackers = Field(None)
    light: Lights = Field(None)
    scatterings: Scatterings = Field(None)
    p_absorb: Absorptions = Field(None)
    shadow: Trackers = Field(None)
    effects: Effects = Field(None)
    lanes: Lanes = Field(None)
    arithmetic: Arithmetics = Field(None)
    storage: Storages = Field(None)


class Exclude(Entry):
    """Cases of the matrix to remove: those that match each of these axes.

    A bare kind matches whatever its parameters, a mapping the parameters that it gives.
    """

    estimand: Estimands = Field(None)
    medium: Annotated[tuple[MediumPattern, ...], OneOrMore()] = Field(None)
    majorant: Annotated[tuple[MajorantPattern, ...], OneOrMore()] = Field(None)
    tightness: Tightnesses = Field(None)
    tracker: Annotated[tuple[TrackerPattern, ...], OneOrMore()] = Field(None)
    light: Annotated[tuple[LightPattern, ...], OneOrMore()] = Field(None)
    scatterings: Scatterings = Field(None)
    p_absorb: Absorptions = Field(None)
    shadow: Annotated[tuple[TrackerPattern, ...], OneOrMore()] = Field(None)
    effects: Effects = Field(None)
    lanes: Lanes = Field(None)
    arithmetic: Arithmetics = Field(None)
    storage: Storages = Field(None)


MOST_SAMPLES = 10**12
"""Of one ray: a quarter of an hour at a nanosecond each, and no sample is as quick."""
PRECISELY, EXACTLY = ("error", "time_noise", "at_most"), ("samples", "rounds")
"""The keys of the two ways to stop; one of the other way would say nothing."""


class Stop(Model):
    """When a case has been measured well enough: both precisions reached, or the time is up."""

    model_config = ConfigDict(
        json_schema_extra={
            "dependentRequired": {"rounds": ["samples"]},
            "dependentSchemas": {"samples": {"properties": dict.fromkeys(PRECISELY, False)}},
        }
    )

    error: Fraction = 0.01
    """Half-width of the 95 % interval of the RMSE of one sample, relative to it."""
    time_noise: Fraction = 0.02
    """Half-width of the 95 % interval of the time of one sample, relative to it."""
    at_most: Annotated[float, Number("time", above=0)] = 10.0
    """Seconds of measuring for one case."""
    samples: Annotated[int, Number("count", minimum=2, maximum=MOST_SAMPLES)] | None = None
    """Exactly so many samples for each ray, instead of the rules above."""
    rounds: Annotated[int, Number("count", minimum=2, maximum=10_000)] = 10
    """How many rounds these samples are taken in, at least; the same layout in every run."""

    @model_validator(mode="wrap")
    @classmethod
    def _of_one_way(cls, data: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        stop = handler(data)
        wrong = {"rounds": "expected beside samples alone, which it divides"}
        if stop.samples is not None:
            why = "expected without samples, of which exactly so many are taken"
            wrong = dict.fromkeys(PRECISELY, why)
        lines = [
            InitErrorDetails(type=failure(text, UNKNOWN_KEY), loc=(name,), input=data)
            for name, text in wrong.items()
            if name in stop.model_fields_set
        ]
        if lines:
            raise ValidationError.from_exception_data(cls.__name__, lines)
        return stop

    def as_dict(self) -> dict[str, Any]:
        """Return what counts, with its defaults, fit for JSON and to be loaded again."""
        return self.model_dump(
            mode="json", include=set(PRECISELY if self.samples is None else EXACTLY)
        )


class Config(Model):
    """A sweep."""

    name: Annotated[str, NAME]
    """Names the result folder."""
    description: Annotated[str, Text()] | None = None
    """What the sweep shows."""
    seed: Seed = 1
    """Seed of all random numbers."""
    rays: Annotated[Kind, OneOf("rays", RAYS)] = Orthographic()
    """The rays that every case is measured on."""
    matrix: Matrix
    """The axes."""
    include: Annotated[tuple[Include, ...], OneOrMore(optional=True)] = ()
    """Cases to add, after exclude."""
    exclude: Annotated[tuple[Exclude, ...], OneOrMore(optional=True)] = ()
    """Cases to remove from the matrix."""
    stop: Stop = Field(default_factory=Stop)
    """When to stop measuring a case."""
    render: Annotated[bool, Flag()] = False
    """Whether each case of orthographic or perspective rays is written as a picture too."""

    _document: Document | None = PrivateAttr(None)
    _overridden: frozenset[str] = PrivateAttr(frozenset())

    def attach(self, document: Document, overridden: frozenset[str]) -> None:
        """Remember the text the config was loaded from, and the axes that were replaced in it."""
        self._document, self._overridden = document, overridden

    @property
    def path(self) -> Path | None:
        """The file it was loaded from; None for one made in a program."""
        return Path(self._document.name) if self._document else None

    @property
    def text(self) -> str:
        """The text it was loaded from, comments included; '' for one made in a program."""
        return self._document.text if self._document else ""

    @property
    def overridden(self) -> frozenset[str]:
        """The axes that overrides have replaced."""
        return self._overridden

    def problem(self, location: Location, message: str) -> Problem:
        """Return a problem with the position that a location has in the config's text."""
        if self._document:
            return self._document.problem(location, message)
        return Problem("config", 0, 0, path_text(location), message)

    def as_dict(self) -> dict[str, Any]:
        """Return everything with its defaults, fit for JSON and to be loaded again."""
        return self.model_dump(mode="json") | {"stop": self.stop.as_dict()}
