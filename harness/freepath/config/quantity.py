"""Numbers with bounds, and with units: lengths, extinctions, times and fractions.

A bare number counts scene units (or seconds). A length with a unit is converted to metres and an
extinction to 1/m, so a scene that uses units at all has the metre as its unit.
"""

import functools
import math
import re
from dataclasses import dataclass
from typing import Any, NamedTuple

from pydantic_core import PydanticCustomError

from freepath.config.rules import Rule, expected
from freepath.errors import did_you_mean

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_NAME = r"[A-Za-zµμ]+(?:(?:\^|\*\*)-?[0-9])?"
_UNIT = rf"(?:(?:1\s*)?/\s*)?{_NAME}(?:\s*[*/]\s*{_NAME})*"
# only this form reaches pint, whose expressions could otherwise be 9**9**9**9
QUANTITY_PATTERN = rf"\s*({_NUMBER})\s*({_UNIT})\s*"
PERCENT_PATTERN = rf"\s*({_NUMBER})\s*%\s*"
LARGEST_EXACT = 2**53
LONGEST = 100
"""Letters of a number with its unit; pint takes a unit apart by recursion."""


class Unit(NamedTuple):
    """A kind of quantity: its noun, an example, and the unit pint converts it to ('' for none)."""

    noun: str
    example: str = ""
    base: str = ""


UNITS = {
    "": Unit("a number"),
    "count": Unit("an integer"),
    "length": Unit("a length", "20 or 20 m", "m"),
    "1/length": Unit("an extinction", "0.5 or 0.5/km", "1/m"),
    "time": Unit("a time", "10 or 10 s", "s"),
    "fraction": Unit("a fraction", "0.01 or 1%"),
}


@functools.cache
def _registry() -> Any:
    # imported on first use: it takes longer than reading a config that has no unit
    import pint

    return pint.UnitRegistry()


def convert(text: str, unit: str) -> float | None:
    """Return a text such as "20 m" or "1%" as a number in the base unit, None if it is not one.

    `unit` is a key of UNITS; lengths come back in m, extinctions in 1/m, times in s.
    """
    if len(text) > LONGEST:
        return None
    if unit == "fraction":
        match = re.fullmatch(PERCENT_PATTERN, text)
        return float(match[1]) / 100 if match else None
    match = re.fullmatch(QUANTITY_PATTERN, text)
    if not match or not UNITS[unit].base:
        return None
    name = re.sub(r"^/", "1/", match[2])
    if name == UNITS[unit].base:
        return float(match[1])
    import pint

    try:
        factor = _registry().Quantity(1.0, _registry().parse_units(name)).to(UNITS[unit].base)
    except (pint.PintError, ValueError):
        return None
    return float(match[1]) * float(factor.magnitude)


@dataclass(frozen=True)
class Number(Rule):
    """A finite number of a kind of UNITS within bounds; truth values and NaN are refused."""

    unit: str = ""
    minimum: float | None = None
    above: float | None = None
    maximum: float | None = None
    below: float | None = None

    def check(self, value: Any, context: Any) -> float | int:
        """Return the number in base units: an int for a count, else a float."""
        number = convert(value, self.unit) if isinstance(value, str) else value
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise expected(self.describe(), value, self._hint(value))
        if not self._whole(number) if self.unit == "count" else not _finite(number):
            raise expected(self.describe(), value)
        if not self._inside(number):
            raise expected(self.describe(), value)
        # adding 0.0 turns -0.0 into 0.0, so that equal numbers are written and hashed alike
        return int(number) if self.unit == "count" else float(number) + 0.0

    @staticmethod
    def _whole(number: float) -> bool:
        # 1e6 is how a person writes a million: it is read as a float, and is a whole number
        return isinstance(number, int) or (abs(number) < LARGEST_EXACT and number.is_integer())

    def _inside(self, number: float) -> bool:
        return (
            (self.minimum is None or number >= self.minimum)
            and (self.above is None or number > self.above)
            and (self.maximum is None or number <= self.maximum)
            and (self.below is None or number < self.below)
        )

    def _hint(self, value: Any) -> str:
        if isinstance(value, str) and re.fullmatch(rf"\s*{_NUMBER}\s*", value):
            return " (a text: write it without quotes)"
        return ""

    def describe(self) -> str:
        """Return for instance "a length > 0, such as 20 or 20 m"."""
        unit = UNITS[self.unit]
        example = f", such as {unit.example}" if unit.example else ""
        return unit.noun + self._range() + example

    def _range(self) -> str:
        if self.minimum is not None and self.maximum is not None:
            return f" from {_plain(self.minimum)} to {_plain(self.maximum)}"
        signs = ((">=", self.minimum), (">", self.above), ("<=", self.maximum), ("<", self.below))
        bounds = [f"{sign} {_plain(bound)}" for sign, bound in signs if bound is not None]
        return " " + " and ".join(bounds) if bounds else ""

    def json_schema(self) -> dict[str, Any]:
        """Return a number schema, or text with a unit; what the unit is, a pattern cannot say."""
        bounds = {
            "minimum": self.minimum,
            "exclusiveMinimum": self.above,
            "maximum": self.maximum,
            "exclusiveMaximum": self.below,
        }
        number: dict[str, Any] = {"type": "integer" if self.unit == "count" else "number"}
        number |= {key: bound for key, bound in bounds.items() if bound is not None}
        if not UNITS[self.unit].example:
            return number
        pattern = PERCENT_PATTERN if self.unit == "fraction" else QUANTITY_PATTERN
        return {"anyOf": [number, {"type": "string", "pattern": f"^{pattern}$"}]}


def _finite(number: float) -> bool:
    try:
        return math.isfinite(number)
    except OverflowError:  # an integer with more digits than a float holds
        return False


def _plain(number: float) -> str:
    return str(int(number)) if float(number).is_integer() else str(number)


@dataclass(frozen=True)
class CountOr(Rule):
    """A whole number from 0 on, or a word that stands for no such number."""

    word: str

    def check(self, value: Any, context: Any) -> int | str:
        if value == self.word and isinstance(value, str):
            return value
        number = value if not isinstance(value, float) or not value.is_integer() else int(value)
        if isinstance(number, bool) or not isinstance(number, int) or number < 0:
            raise expected(self.describe(), value)
        return number

    def describe(self) -> str:
        return f"an integer >= 0 or {self.word}"

    def json_schema(self) -> dict[str, Any]:
        return {"anyOf": [Number("count", minimum=0).json_schema(), {"const": self.word}]}


@dataclass(frozen=True)
class NumberOr(Rule):
    """A number of a rule, or one of some words that stand for no such number."""

    number: Number
    words: tuple[str, ...]

    def check(self, value: Any, context: Any) -> float | int | str:
        if isinstance(value, str) and value in self.words:
            return value
        try:
            return self.number.check(value, context)
        except PydanticCustomError:
            hint = did_you_mean(value, self.words) if isinstance(value, str) else ""
            raise expected(self.describe(), value, hint) from None

    def describe(self) -> str:
        return " or ".join([", ".join(self.words), self.number.describe()])

    def json_schema(self) -> dict[str, Any]:
        return {"anyOf": [self.number.json_schema(), {"enum": list(self.words)}]}
