"""A whole config: the matrix of axes, the entries that add and remove cases, when to stop."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    ConfigDict,
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    ValidationError,
    ValidatorFunctionWrapHandler,
    create_model,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails

from freepath.config.axes import AXES
from freepath.config.base import UNKNOWN_KEY, Kind, Model, OneOf
from freepath.config.document import Document, Location, path_text
from freepath.config.models import Fraction, Seed
from freepath.config.quantity import Number
from freepath.config.rays import RAYS, Orthographic
from freepath.config.rules import Flag, OneOrMore, Text, expected, failure
from freepath.errors import Problem

NAME = Text("a name of letters, digits, '.', '_' and '-'", r"[A-Za-z0-9][A-Za-z0-9._-]*")

Matrix = create_model(
    "Matrix",
    __base__=Model,
    __doc__="Axes whose every combination is a case; one value is an axis of one.",
    **{
        axis.name: (
            axis.values(optional=axis.default == ()),
            Field(... if axis.default is None else axis.default, description=axis.meaning),
        )
        for axis in AXES.values()
    },
)


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


Include = create_model(
    "Include",
    __base__=Entry,
    __doc__="Cases to add: the product of these axes, and of the matrix's for those left out.",
    **{axis.name: (axis.values(), Field(None)) for axis in AXES.values()},
)
Exclude = create_model(
    "Exclude",
    __base__=Entry,
    __doc__="""Cases of the matrix to remove: those that match each of these axes.

A bare kind matches whatever its parameters, a mapping the parameters that it gives.""",
    **{axis.name: (axis.values(pattern=True), Field(None)) for axis in AXES.values()},
)


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
    """Exactly this many samples for each ray, instead of the rules above."""
    rounds: Annotated[int, Number("count", minimum=2, maximum=10_000)] = 10
    """How many rounds these samples are taken in, at least; the same layout in every run."""

    @model_validator(mode="wrap")
    @classmethod
    def _of_one_way(cls, data: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        stop = handler(data)
        wrong = {"rounds": "expected beside samples alone, which it divides"}
        if stop.samples is not None:
            why = "expected without samples, of which exactly N are taken"
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

    def override(self, axes: frozenset[str]) -> None:
        """Remember axes that were replaced where this was loaded first."""
        self._overridden = axes

    @property
    def path(self) -> Path | None:
        """The file it was loaded from; None for one made in a program."""
        return Path(self._document.name) if self.text else None

    @property
    def search_path(self) -> list[Path]:
        """Where volumes, rays and images are looked for first: beside the config."""
        return [self.path.parent] if self.path else []

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
