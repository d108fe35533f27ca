import subprocess
import sys

import jsonschema
import pytest
from pydantic_core import PydanticCustomError

from freepath.config.quantity import UNITS, Number, convert


def refusal(rule, value):
    with pytest.raises(PydanticCustomError) as caught:
        rule.check(value, None)
    return caught.value.message()


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("20 m", "length", 20),
        ("20m", "length", 20),
        (" 1.5 km ", "length", 1500),
        ("-2 cm", "length", -0.02),
        ("1e3 mm", "length", 1),
        ("3 µm", "length", 3e-6),
        (".5 ft", "length", 0.1524),
        ("0.5/km", "1/length", 5e-4),
        ("1/km", "1/length", 1e-3),
        ("0.5 1/km", "1/length", 5e-4),
        ("2 km^-1", "1/length", 2e-3),
        ("2 km**-1", "1/length", 2e-3),
        ("4 m^2/m^3", "1/length", 4),
        ("500 ms", "time", 0.5),
        ("2 min", "time", 120),
        ("1%", "fraction", 0.01),
        ("2.5 %", "fraction", 0.025),
    ],
)
def test_converts_to_base_units(text, unit, number):
    assert convert(text, unit) == pytest.approx(number, rel=1e-12)
    assert Number(unit).check(text, None) == pytest.approx(number, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("20 s", "length"),
        ("20 m", "1/length"),
        ("20/m", "length"),
        ("20 m", "time"),
        ("20 m^2", "length"),
        ("20 parsnips", "length"),
        ("20 KM", "length"),
        ("20 %", "length"),
        ("20 m", "fraction"),
        ("1 % %", "fraction"),
        ("20 m", ""),
        ("1%", ""),
        ("3 m", "count"),
        ("20", "length"),
        ("m", "length"),
        ("", "length"),
        ("nan m", "length"),
        ("inf m", "length"),
        ("1e999 m", "length"),
        ("1,5 m", "length"),
        ("9**9**9**9 m", "length"),
        ("1 m + 1 m", "length"),
        ("1 __import__", "length"),
        ("20 degC", "length"),
    ],
)
def test_refuses_other_dimensions_and_expressions(text, unit):
    assert "got " + repr(text) in refusal(Number(unit), text)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize(
    "value", [True, False, None, [], {}, "", float("nan"), float("inf"), float("-inf"), 10**400]
)
def test_no_kind_of_number_accepts(unit, value):
    if unit == "count" and value == 10**400:
        value = 1e400
    assert "expected " + UNITS[unit].noun in refusal(Number(unit), value)


def test_whole_floats_are_counts_and_others_are_not():
    count = Number("count", minimum=1)
    assert count.check(1e6, None) == 1_000_000
    assert type(count.check(1e6, None)) is int
    assert refusal(count, 1.5) == "expected an integer >= 1, got 1.5"
    assert refusal(count, 1e300) == "expected an integer >= 1, got 1e+300"


def test_integers_become_floats_and_minus_zero_is_zero():
    assert type(Number().check(3, None)) is float
    assert str(Number().check(-0.0, None)) == "0.0"


@pytest.mark.parametrize(
    ("rule", "good", "bad"),
    [
        (Number(minimum=1), 1, 0.999),
        (Number(above=1), 1.001, 1),
        (Number(maximum=1), 1, 1.001),
        (Number(below=1), 0.999, 1),
        (Number("fraction", above=0, maximum=1), "100%", "101%"),
        (Number("length", above=0), "1 nm", "0 m"),
    ],
)
def test_bounds(rule, good, bad):
    rule.check(good, None)
    assert refusal(rule, bad).startswith(f"expected {rule.describe()}, got")


@pytest.mark.parametrize(
    ("rule", "words"),
    [
        (Number(), "a number"),
        (Number("count", minimum=1), "an integer >= 1"),
        (Number("count", minimum=2, maximum=1024), "an integer from 2 to 1024"),
        (Number(above=0, below=180), "a number > 0 and < 180"),
        (Number("length", above=0), "a length > 0, such as 20 or 20 m"),
        (Number("1/length", minimum=0), "an extinction >= 0, such as 0.5 or 0.5/km"),
    ],
)
def test_describes_itself(rule, words):
    assert rule.describe() == words


def test_a_quoted_number_is_explained():
    message = "expected a number, got '5' (a text: write it without quotes)"
    assert refusal(Number(), "5") == message


@pytest.mark.parametrize(
    ("rule", "value", "valid"),
    [
        (Number("length", above=0), "20 m", True),
        (Number("length", above=0), 20, True),
        (Number("length", above=0), 0, False),
        (Number("length"), "20", False),
        (Number("length"), True, False),
        (Number("1/length"), "1/km", True),
        (Number("1/length"), "2 km^-1", True),
        (Number("fraction"), "1 %", True),
        (Number("fraction"), "1 m", False),
        (Number("count", minimum=1), 1, True),
        (Number("count", minimum=1), 1.5, False),
        (Number(), "1 m", False),
    ],
)
def test_json_schema_accepts_the_same(rule, value, valid):
    assert jsonschema.Draft202012Validator(rule.json_schema()).is_valid(value) is valid


def test_pint_is_imported_only_for_a_unit():
    code = (
        "import sys; from freepath.config import quantity as q;"
        "q.Number('length').check(3, None); q.Number('fraction').check('1%', None);"
        "assert q.Number('time').check('10 s', None) == 10;"
        "assert q.Number('1/length').check('3 /m', None) == 3;"
        "assert 'pint' not in sys.modules;"
        "q.Number('length').check('3 km', None); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_unit_of_a_thousand_factors_is_none():
    assert convert("1 m*m/m", "length") == 1.0
    assert convert("1 /" + "*".join(["m"] * 1000), "1/length") is None
