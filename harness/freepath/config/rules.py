"""What a value in a config may be: annotations that check it and describe themselves in words.

pydantic's own messages name its types ("Input should be a valid integer"). The rules here say what
was expected in the words of the config's author, and carry the JSON Schema of what they accept.
"""

import datetime
import re
import typing
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from freepath.errors import did_you_mean

LONGEST_SHOWN = 40
LISTED_NAMES = 30


def shown(value: Any) -> str:
    """Return a value as an error message shows it: short, and text in quotes."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a mapping" if value else "an empty mapping"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}" if value else "an empty list"
    if isinstance(value, (datetime.date, int, float)):
        return _cut(str(value))
    return _cut(repr(value))


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 4] + "..." + text[-1]


def failure(message: str, kind: str = "expected") -> PydanticCustomError:
    """Return the error to raise inside a validator; `kind` says where the caret belongs."""
    # the message is handed over as a value: in the template its braces would be replaced
    return PydanticCustomError(kind, "{message}", {"message": message})


def expected(what: str, value: Any, hint: str = "") -> PydanticCustomError:
    """Return the error "expected WHAT, got VALUE"."""
    return failure(f"expected {what}, got {shown(value)}{hint}")


def one_of(names: Iterable[Any]) -> str:
    """Return "one of a, b, c" (or "a or b")."""
    words = [str(name) for name in names]
    if len(words) <= 2:
        return " or ".join(words)
    more = ", ..." if len(words) > LISTED_NAMES else ""
    return "one of " + ", ".join(words[:LISTED_NAMES]) + more


class Rule:
    """An annotation for one value; subclasses define check, describe and json_schema."""

    def check(self, value: Any, context: Any) -> Any:
        """Return the value as the program uses it, or raise what `expected` returns."""
        raise NotImplementedError

    def describe(self) -> str:
        """Return what is expected, to follow the word "expected"."""
        raise NotImplementedError

    def json_schema(self) -> dict[str, Any]:
        """Return the JSON Schema of what `check` accepts."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        def check(value: Any, info: core_schema.ValidationInfo) -> Any:
            return self.check(value, info.context)

        return core_schema.with_info_plain_validator_function(check)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return self.json_schema()


@dataclass(frozen=True)
class Text(Rule):
    """A text, blank only where said; a `pattern`, explained by `what`, matches all of it."""

    what: str = "a text"
    pattern: str = ""
    blank: bool = False

    def check(self, value: Any, context: Any) -> str:
        """Return the text; a number or a truth value is none."""
        if not isinstance(value, str) or not (value.strip() or self.blank):
            raise expected(self.what, value)
        if self.pattern and not re.fullmatch(self.pattern, value):
            raise expected(self.what, value)
        return value

    def describe(self) -> str:
        """Return what the text is."""
        return self.what

    def json_schema(self) -> dict[str, Any]:
        """Return a string schema."""
        if self.blank:
            return {"type": "string"}
        return {"type": "string", "pattern": f"^{self.pattern}$" if self.pattern else r"\S"}


@dataclass(frozen=True)
class Choice(Rule):
    """One of a few given words or integers."""

    choices: tuple[str | int, ...]

    def check(self, value: Any, context: Any) -> str | int:
        """Return the choice that equals the value; true is not 1."""
        if isinstance(value, (str, int, float)) and not isinstance(value, bool):
            for choice in self.choices:
                if choice == value:
                    return choice
        words = [choice for choice in self.choices if isinstance(choice, str)]
        hint = did_you_mean(value, words) if isinstance(value, str) else ""
        raise expected(self.describe(), value, hint)

    def describe(self) -> str:
        return one_of(self.choices)

    def json_schema(self) -> dict[str, Any]:
        return {"enum": list(self.choices)}


@dataclass(frozen=True)
class Flag(Rule):
    """A truth value: true or false."""

    def check(self, value: Any, context: Any) -> bool:
        """Return the truth value; 0 and 1 are numbers."""
        if not isinstance(value, bool):
            raise expected(self.describe(), value)
        return value

    def describe(self) -> str:
        return "true or false"

    def json_schema(self) -> dict[str, Any]:
        return {"type": "boolean"}


class _Wrapper:
    """An annotation of a tuple that prepares the value before its elements are checked."""

    def prepare(self, value: Any) -> Any:
        """Return the list whose elements are checked next."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.prepare, handler(source))


@dataclass(frozen=True)
class OneOrMore(_Wrapper):
    """A list, or one value that stands for a list of one; nothing at all only where `optional`."""

    optional: bool = False

    def prepare(self, value: Any) -> Any:
        if value is None and self.optional:
            return []
        if isinstance(value, (list, tuple)):
            if not value and not self.optional:
                raise expected("at least one value", value)
            return value
        return [value]

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        several = handler(schema)
        if self.optional:
            return {"anyOf": [several["items"], several, {"type": "null"}]}
        return {"anyOf": [several["items"], {**several, "minItems": 1}]}


@dataclass(frozen=True)
class Several(_Wrapper):
    """A list of at least and at most N values."""

    least: int
    most: int

    def prepare(self, value: Any) -> Any:
        if not isinstance(value, (list, tuple)) or not self.least <= len(value) <= self.most:
            raise expected(self.describe(), value)
        return value

    def describe(self) -> str:
        return f"a list of {self.least} to {self.most} numbers"

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {**handler(schema), "minItems": self.least, "maxItems": self.most}


@dataclass(frozen=True)
class Exactly(_Wrapper):
    """A list with one value for each of `names`; where `spread`, one value may stand for all."""

    names: tuple[str, ...] = ("x", "y", "z")
    spread: bool = False

    def prepare(self, value: Any) -> Any:
        if isinstance(value, (list, tuple)):
            if len(value) != len(self.names):
                raise expected(self.describe(), value)
            return value
        if not self.spread or value is None or isinstance(value, dict):
            raise expected(self.describe(), value)
        return [value] * len(self.names)

    def describe(self) -> str:
        return ("one number or " if self.spread else "") + f"a list [{', '.join(self.names)}]"

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        several = handler(schema)
        return {"anyOf": [several["prefixItems"][0], several]} if self.spread else several


def describe(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    """Return what an annotation expects, from the outermost rule that can say so."""
    for rule in reversed(list(metadata)):
        if hasattr(rule, "describe"):
            return rule.describe()
    if typing.get_origin(annotation) is typing.Annotated:
        return describe(annotation.__origin__, annotation.__metadata__)
    inner = [part for part in typing.get_args(annotation) if part is not type(None)]
    if inner:
        return describe(inner[0])
    if hasattr(annotation, "model_fields"):
        return "a mapping with " + ", ".join(annotation.model_fields)
    return "a value"
