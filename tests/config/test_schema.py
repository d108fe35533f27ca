import json

import jsonschema
import pytest
from test_loading import BAD_MATRIX, EVERY_KIND, matrix

from freepath import config
from freepath.cli import main
from freepath.compose import catalog
from freepath.config.document import Document
from freepath.config.schema import json_schema


@pytest.fixture(scope="module")
def validator(small_catalog):
    schema = json_schema(small_catalog.parameter_models())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.fixture(scope="module")
def of_all():
    return jsonschema.Draft202012Validator(json_schema(catalog.load().parameter_models()))


def test_the_command_writes_it(tmp_path, capsys):
    assert main(["schema", "-o", str(tmp_path / "schema.json")]) == 0
    assert main(["schema"]) == 0
    text = (tmp_path / "schema.json").read_text("utf-8")
    assert capsys.readouterr().out == text
    assert json.loads(text) == json_schema(catalog.load().parameter_models())


def test_the_command_refuses_what_it_cannot_write(tmp_path, capsys):
    assert main(["schema", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err == (
        f"freepath: {tmp_path}: expected a file that can be written: Is a directory\n"
    )


@pytest.mark.parametrize("name", config.shipped())
def test_every_config_that_ships_is_accepted(name, of_all):
    path = config.find(name)
    data = Document.parse(name, path.read_text(encoding="utf-8")).data
    assert [error.message for error in of_all.iter_errors(data)] == []
    assert config.load(path, catalog.load().parameter_models()).name == name


def test_every_short_form_is_accepted(validator):
    data = Document.parse("x", EVERY_KIND).data
    assert [error.message for error in validator.iter_errors(data)] == []


# what JSON Schema cannot say: dimensions of units, order, sums, and that a number is finite
BEYOND_SCHEMA = ("1 s}", "5 m}", "layered", ".nan", "1e999", "resolution: 1000}", "rayleigh")


@pytest.mark.parametrize("lines", [lines for lines, *_ in BAD_MATRIX])
def test_what_the_config_refuses_the_schema_refuses(validator, lines):
    data = Document.parse("x", matrix(lines)).data
    assert validator.is_valid(data) is any(part in lines for part in BEYOND_SCHEMA)


def test_nothing_of_the_generator_is_left_over(small_catalog):
    text = json.dumps(json_schema(small_catalog.parameter_models()))
    assert "kind_definition" not in text
    for definition in ("medium", "majorant", "rays", "tracker", "tracker_pattern"):
        assert f'"#/$defs/{definition}"' in text


def test_trackers_take_part_in_the_schema(validator):
    good = {"name": "x", "matrix": {"medium": {"homogeneous": {"sigma_t": 1}}, "tracker": "march"}}
    assert validator.is_valid(good)
    for tracker in ("marsh", {"march": {"stp": 1}}, {"march": {"step": 0}}, {"march": {}, "x": {}}):
        bad = {**good, "matrix": {**good["matrix"], "tracker": tracker}}
        assert not validator.is_valid(bad)
