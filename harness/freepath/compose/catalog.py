"""The trackers: each is one .cl file whose front matter says what it is, needs and takes."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import ValidationInfo, create_model, field_validator

from freepath.compose.kernel_files import (
    CONTRACT,
    ended_in_begin,
    functions,
    split_front_matter,
)
from freepath.config.axes import ESTIMANDS
from freepath.config.base import Kind, Model
from freepath.config.document import Document
from freepath.config.loading import read_text
from freepath.config.models import MAJORANTS
from freepath.config.quantity import UNITS, Number
from freepath.config.rules import Choice, Flag, OneOrMore, Rule, Text, expected, failure
from freepath.errors import CatalogError, ConfigError, Problem
from freepath.paths import KERNELS

NEEDS = ("majorant", "control", "closed_form", "cells", "light")
ANY = "any"
USES = ("math/inverse_distance", "math/newton", "math/symmetric_means")
"""General mathematics in kernels/ that a tracker may have composed before it."""
STATE = r"(real|mask|index)(\[[1-9][0-9]?\])?"
"""What a tracker may keep of a path: types that main.cl can merge under a mask, and arrays of them
as scratch, which a sample fills before it reads them."""
IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
# fmt: off
C_WORDS = frozenset((
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else",
    "enum", "extern", "float", "for", "goto", "half", "if", "inline", "int", "long",
    "register", "restrict", "return", "short", "signed", "sizeof", "static", "struct",
    "switch", "typedef", "union", "unsigned", "void", "volatile", "while", "kernel", "global",
    "local", "constant", "private",
))
# fmt: on

Bound = Annotated[float, Number()] | None


class Parameter(Model):
    """A parameter of a tracker: a number within bounds, or one of some choices."""

    unit: Annotated[str, Choice(tuple(UNITS))] = ""
    minimum: Bound = None
    above: Bound = None
    maximum: Bound = None
    below: Bound = None
    choices: Annotated[tuple[Any, ...], OneOrMore()] | None = None
    meaning: Annotated[str, Text()] | None = None
    host: Annotated[bool, Flag()] = False
    """Read by the host alone, when it makes majorants and controls; kernels do not see it."""
    later: Annotated[bool, Flag()] = False
    """Whether the tracker had no such parameter at first: ids of cases stay where it is usual."""
    default: Any

    @field_validator("choices", mode="after")
    @classmethod
    def _defines(cls, choices: tuple[Any, ...] | None) -> tuple[Any, ...] | None:
        # a choice becomes a #define, so it must be a word or an integer there too
        for choice in choices or ():
            if not is_identifier(choice) and type(choice) is not int:
                raise expected("words or integers as choices", choice)
        return choices

    @field_validator("default", mode="after")
    @classmethod
    def _allowed(cls, default: Any, info: ValidationInfo) -> Any:
        if len(info.data) < len(cls.model_fields) - 1:
            return default  # another key is wrong and reported, so the rule is not known
        return _rule(info.data).check(default, None)

    def rule(self) -> Rule:
        """Return what a config may give for this parameter."""
        return _rule(dict(self))


def _rule(keys: dict[str, Any]) -> Rule:
    bounds = {name: keys[name] for name in ("minimum", "above", "maximum", "below")}
    if keys["choices"] is None:
        return Number(keys["unit"], **bounds)
    if keys["unit"] or any(bound is not None for bound in bounds.values()):
        raise failure("expected choices without a unit or bounds, got both")
    return Choice(keys["choices"])


class Bounding(Flag):
    """Whether the majorant must bound: true, false, or the choices of a parameter that need it."""

    def check(self, value: Any, context: Any) -> Any:
        """Return the truth value, or the choices by parameter."""
        if isinstance(value, dict) and all(isinstance(given, list) for given in value.values()):
            return {name: tuple(given) for name, given in value.items()}
        return super().check(value, context)

    def describe(self) -> str:
        """Return what may be written."""
        return "true, false or {parameter: [choices]}"


class Channels(Rule):
    """How many channels a path follows: a number, or `any` for those that the medium has."""

    def check(self, value: Any, context: Any) -> Any:
        """Return the number, or `any`."""
        return value if value == ANY else Number("count", minimum=1).check(value, context)

    def describe(self) -> str:
        """Return what may be written."""
        return "any or an integer >= 1"


Needs = Annotated[frozenset[Annotated[str, Choice(NEEDS)]], OneOrMore(optional=True)]


class FrontMatter(Model):
    """The YAML in the first comment of a tracker's file."""

    title: Annotated[str, Text()]
    estimands: Annotated[tuple[Annotated[str, Choice(ESTIMANDS)], ...], OneOrMore()]
    needs: Needs = frozenset()
    channels: Annotated[int | str, Channels()] = 1
    """How many it follows; ANY for as many as the medium has, each with a weight of its own."""
    majorants: Annotated[tuple[Annotated[str, Choice(tuple(MAJORANTS))], ...], OneOrMore()] = tuple(
        MAJORANTS
    )
    bounding: Annotated[bool | dict[str, tuple[Any, ...]], Bounding()] = False
    """Whether it is only right where the majorant bounds; or for which choices of a parameter."""
    escapes: Annotated[bool, Flag()] = True
    """Whether a flight may leave the medium: one that never does meets no environment."""
    aims: Annotated[bool, Flag()] = False
    """Whether directions are chosen with the light in mind too, by light/aimed_direction."""
    single_flight: Annotated[bool | dict[str, tuple[Any, ...]], Bounding()] = False
    """Whether, or for which choices, what it scores on its way is for no path that goes on."""
    shares_lookup: Any = None
    unbiased: Annotated[bool, Flag()] = True
    parameters: dict[str, Parameter] = {}
    uses: Annotated[tuple[Annotated[str, Choice(USES)], ...], OneOrMore(optional=True)] = ()
    state: dict[str, Annotated[str, Text("real, mask or index, or an array of them", STATE)]] = {}
    """Fields that a path carries for this tracker: their names and types."""
    like: Annotated[str, Text("a tracker's name", r"[A-Za-z]\w*")] | None = None
    """The tracker that `freepath try` compares it with."""
    citation: Annotated[str, Text()] = ""

    @field_validator("shares_lookup", mode="before")
    @classmethod
    def _gone(cls, _: Any) -> Any:
        what = (
            "leave it out: a tracker that defines at_tentative in place of step shares its lookup"
        )
        raise failure(f"expected no such key any more; {what} (kernels/README.md)")

    @field_validator("parameters", "state", mode="before")
    @classmethod
    def _names(cls, fields: Any, info: ValidationInfo) -> Any:
        if fields is None:
            return {}
        what = "parameter" if info.field_name == "parameters" else "state"
        if not isinstance(fields, dict):
            raise expected(f"a mapping of {what} names", fields)
        for name in fields:
            if not is_identifier(name) or (what == "parameter" and hasattr(Kind, name)):
                raise failure(f"expected a C identifier as the {what}'s name, got '{name}'")
        return fields


class Tracker(FrontMatter):
    """A tracker: the front matter of its file, its code, and the file's whole text."""

    name: str
    path: Path
    source: str
    code: str
    """The text with empty lines for the front matter: line numbers are those of the file."""
    model: type[Kind]
    """Of its parameters, as a config may give them."""


@dataclass(frozen=True)
class Catalog:
    """The trackers by name."""

    trackers: dict[str, Tracker]

    def parameter_models(self) -> dict[str, type[Kind]]:
        """Return what config.load needs: the model of each tracker's parameters, by name."""
        return {name: tracker.model for name, tracker in self.trackers.items()}


def is_identifier(name: Any) -> bool:
    """Tell whether a name can stand in OpenCL C; an underscore first is left to the compiler."""
    return isinstance(name, str) and bool(IDENTIFIER.fullmatch(name)) and name not in C_WORDS


def load(directories: Iterable[Path | str] = (), *, builtin: bool = True) -> Catalog:
    """Load the trackers of freepath (unless not `builtin`), of further folders and of .cl files.

    Raises CatalogError with every problem of every file.
    """
    files: list[Path] = _builtin_files() if builtin else []
    problems: list[Problem] = []
    for directory in directories:
        given = Path(directory)
        found = [given] if given.is_file() else sorted(given.glob("*.cl"))
        if not found:
            problem = "expected a folder with .cl files, got none"
            problems.append(Problem(str(directory), 0, 0, "", problem))
        files += found
    trackers: dict[str, Tracker] = {}
    for file in files:
        try:
            tracker = read(file)
            if tracker.name in trackers and file.resolve() != trackers[tracker.name].path.resolve():
                first = trackers[tracker.name].path
                raise _bad(file, f"expected a new name, got '{file.stem}' again (first in {first})")
        except ConfigError as error:
            problems += error.problems
        else:
            trackers[tracker.name] = tracker
    if problems:
        raise CatalogError("\n".join(str(problem) for problem in problems))
    return Catalog(dict(sorted(trackers.items())))


def _builtin_files() -> list[Path]:
    return sorted((KERNELS / "trackers").glob("*.cl"))


def _bad(file: Path, message: str) -> ConfigError:
    return ConfigError([Problem(str(file), 1, 1, "", message)])


def read(file: Path) -> Tracker:
    """Read one tracker; raises ConfigError with the problems of its front matter."""
    if not is_identifier(file.stem):
        raise _bad(file, f"expected a C identifier as the file's name, got '{file.stem}'")
    source = read_text(file).replace("\r\n", "\n")
    text, code = split_front_matter(source)
    if text is None:
        raise _bad(file, "expected front matter, /*--- ... ---*/, as the first comment")
    document = Document.parse(str(file), text)
    if document.data is None:
        raise _bad(file, "expected title and estimands in the front matter, got nothing")
    front: FrontMatter = document.validate(FrontMatter)
    _check_functions(file, code, front)
    model = _parameter_model(file.stem, front)
    given = {"name": file.stem, "path": file, "source": source, "code": code, "model": model}
    return Tracker.model_construct(**dict(front) | given)


def _check_functions(file: Path, code: str, front: FrontMatter) -> None:
    """Raise ConfigError where a tracker cannot be called."""
    got = [name for name in CONTRACT if name in functions(code)]
    if got not in (["begin", "step"], ["begin", "at_tentative"], ["at_tentative"]):
        what = "the functions begin and step, or at_tentative in place of step"
        raise _bad(file, f"expected {what}, got {' and '.join(got) or 'none'} (kernels/README.md)")
    if ends := ended_in_begin(code):
        what = f"expected begin to leave its path flying, got {ends[1]} there: only a path that "
        what += "ends in step is counted, this one would be begun for ever (kernels/README.md)"
        raise ConfigError([Problem(str(file), ends[0], 1, "", what)])
    if "step" not in got and ("majorant" not in front.needs or "control" in front.needs):
        raise _bad(file, "expected needs: [majorant], and no control, for at_tentative")


def _parameter_model(name: str, front: FrontMatter) -> type[Kind]:
    fields: dict[str, Any] = {
        key: (Annotated[Any, parameter.rule()], parameter.default)
        for key, parameter in front.parameters.items()
    }
    model = create_model(name, __base__=Kind, __doc__=front.title, **fields)
    model.kind, model.NEEDS = name, frozenset(front.needs)
    model.LATER = frozenset(key for key, given in front.parameters.items() if given.later)
    return model
