import pytest
from pydantic import ValidationError

from conftest import tracker_text
from freepath.compose import catalog
from freepath.errors import CatalogError

FRONT = "estimands: [transmittance]"


def load_one(folder, text, name="mine"):
    (folder / f"{name}.cl").write_text(text)
    return catalog.load([folder], builtin=False)


def complaints(folder, text, name="mine"):
    with pytest.raises(CatalogError) as caught:
        load_one(folder, text, name)
    return str(caught.value).replace(f"{folder}/", "")


def test_the_trackers_that_come_with_freepath():
    trackers = catalog.load().trackers
    assert set(trackers) >= {"analytic", "regular", "march", "delta", "ratio", "lookup_only"}
    assert list(trackers) == sorted(trackers)
    for name, tracker in trackers.items():
        assert tracker.name == name
        assert tracker.title
        assert tracker.source.startswith("/*---")
        tracker.model()  # its defaults make a bare name valid
    assert trackers["delta"].needs == {"majorant"}
    assert trackers["delta"].bounding
    assert not trackers["march"].unbiased


def test_a_tracker_reads_like_an_algorithm():
    """Below 60 lines each, comments and blank lines among them, without the front matter."""
    for tracker in catalog.load().trackers.values():
        assert len(tracker.code.strip().split("\n")) < 60, tracker.name


def test_everything_in_the_front_matter_is_read(tmp_path):
    front = """\
estimands: [transmittance, free_path]
needs: [majorant, cells]
channels: 3
bounding: true
unbiased: false
uses: math/symmetric_means
parameters:
  step: {unit: length, default: 2 cm, above: 0, meaning: length of a step}
  share: {unit: fraction, default: 50%, minimum: 0, maximum: 1}
  order: {unit: count, default: 2, minimum: 1}
  placement: {choices: [start, midpoint], default: midpoint, meaning: where}
  words: {choices: [1, 2], default: 2}
citation: >-
  Someone 2014,
  Something, eq. 9"""
    text = tracker_text(front, "'Mine: all of it'")
    mine = load_one(tmp_path, text).trackers["mine"]
    assert mine.path == tmp_path / "mine.cl"
    assert mine.source == text
    assert mine.title == "Mine: all of it"
    assert mine.estimands == ("transmittance", "free_path")
    assert mine.needs == {"majorant", "cells"}
    assert (mine.channels, mine.bounding, mine.unbiased) == (3, True, False)
    assert mine.citation == "Someone 2014, Something, eq. 9"
    assert mine.uses == ("math/symmetric_means",)
    assert mine.parameters["step"].unit == "length"
    assert mine.parameters["step"].meaning == "length of a step"
    assert mine.parameters["placement"].choices == ("start", "midpoint")
    assert mine.model().parameters() == {
        "step": 0.02,
        "share": 0.5,
        "order": 2,
        "placement": "midpoint",
        "words": 2,
    }


def test_what_may_be_left_out(tmp_path):
    mine = load_one(tmp_path, tracker_text(FRONT)).trackers["mine"]
    assert (mine.needs, mine.channels, mine.bounding, mine.unbiased) == (
        frozenset(),
        1,
        False,
        True,
    )
    assert (mine.parameters, mine.citation, mine.model().parameters()) == ({}, "", {})
    again = load_one(tmp_path, tracker_text(FRONT + "\nneeds:\nparameters:\n")).trackers["mine"]
    assert (again.needs, again.parameters) == (frozenset(), {})


def test_windows_lines_and_space_before_the_comment_are_read(tmp_path):
    text = "\n  " + tracker_text(FRONT)
    (tmp_path / "mine.cl").write_bytes(text.replace("\n", "\r\n").encode())
    assert catalog.load([tmp_path], builtin=False).trackers["mine"].source == text


def test_parameter_models_check_what_a_config_gives(tmp_path):
    front = FRONT + "\nparameters: {step: {unit: length, default: 1, above: 0}}"
    model = load_one(tmp_path, tracker_text(front)).parameter_models()["mine"]
    assert model.kind == "mine"
    assert model(step="1 km").parameters() == {"step": 1000.0}
    for bad in ({"step": 0}, {"step": "1 s"}, {"stp": 1}):
        with pytest.raises(ValidationError):
            model.model_validate(bad)


# (the front matter, from line 2 of the file on; line, column and text of the message)
BAD_FRONT = [
    ("title: x\nestimands: []", 3, 12, "estimands: expected at least one value, got an empty list"),
    (
        "title: x",
        2,
        1,
        "estimands: expected one of transmittance, free_path, radiance, path_length",
    ),
    ("estimands: transmittance", 2, 1, "title: expected a text, got nothing"),
    ("title: 3\nestimands: transmittance", 2, 8, "title: expected a text, got 3"),
    ("title: x\nestimands: [radience]", 3, 13, "estimands[0]: expected one of transmittance"),
    ("{F}\nneeds: [majorants]", 4, 9, "got 'majorants'; did you mean 'majorant'?"),
    ("{F}\nuses: [math/newtom]", 4, 8, "got 'math/newtom'; did you mean 'math/newton'?"),
    ("{F}\nneed: [majorant]", 4, 1, "need: unknown key; did you mean 'needs'?"),
    ("{F}\nchannels: 0", 4, 11, "channels: expected an integer >= 1, got 0"),
    ("{F}\nbounding: yes", 4, 11, "bounding: expected true, false or"),
    ("{F}\nunbiased: 1", 4, 11, "unbiased: expected true or false, got 1"),
    ("{F}\ncitation: [a]", 4, 11, "citation: expected a text, got a list of 1"),
    ("{F}\nparameters: [a]", 4, 13, "parameters: expected a mapping of parameter names"),
    ("{F}\nparameters: {a: 3}", 4, 17, "parameters.a: expected a mapping with unit, minimum"),
    ("{F}\nparameters: {a: {}}", 4, 17, "parameters.a.default: expected a value, got nothing"),
    ("{F}\nparameters: {a: {default: 0, above: 0}}", 4, 27, "expected a number > 0, got 0"),
    ("{F}\nparameters: {a: {default: 5, maximum: 4}}", 4, 27, "expected a number <= 4, got 5"),
    ("{F}\nparameters: {a: {default: 1 m}}", 4, 27, "expected a number, got '1 m'"),
    ("{F}\nparameters: {a: {default: 1 s, unit: length}}", 4, 27, "expected a length"),
    ("{F}\nparameters: {a: {default: 1.5, unit: count}}", 4, 27, "expected an integer, got 1.5"),
    ("{F}\nparameters: {a: {default: 1, unit: lenght}}", 4, 36, "did you mean 'length'?"),
    ("{F}\nparameters: {a: {default: 1, abov: 0}}", 4, 30, "parameters.a.abov: unknown key; did"),
    ("{F}\nparameters: {a: {default: z, choices: [x, y]}}", 4, 27, "expected x or y, got 'z'"),
    ("{F}\nparameters: {a: {default: x, choices: [x, y z]}}", 4, 39, "words or integers"),
    ("{F}\nparameters: {a: {default: x, choices: [x], unit: length}}", 4, 27, "without a unit"),
    ("{F}\nparameters: {a b: {default: 1}}", 4, 13, "expected a C identifier as the parameter's"),
    ("{F}\nparameters: {float: {default: 1}}", 4, 13, "expected a C identifier as the parameter"),
    ("{F}\nparameters: {copy: {default: 1}}", 4, 13, "expected a C identifier as the parameter's"),
    ("{F}\ntitle: y", 4, 1, "title: expected a key once, got it again (first in line 2)"),
    ("{F}\n\tchannels: 1", 4, 1, "expected spaces, got a tab"),
    ("{F}\nchannels: [1", 4, 11, "not valid YAML"),
    ("- 1", 2, 1, "expected a mapping with title, estimands, needs"),
]


@pytest.mark.parametrize(("front", "line", "column", "message"), BAD_FRONT)
def test_bad_front_matter(tmp_path, front, line, column, message):
    front = front.replace("{F}", f"title: x\n{FRONT}")
    said = complaints(tmp_path, f"/*---\n{front}\n---*/\nvoid f(void) {{}}\n")
    assert said.startswith(f"mine.cl:{line}:{column}: ")
    assert message in said.splitlines()[0]
    if "YAML" not in message and "key once" not in message:
        assert said.splitlines()[1] == "    " + front.splitlines()[line - 2].replace("\t", " ")


BOTH = "begin and step, or at_tentative in place of step, got "


@pytest.mark.parametrize(
    ("needs", "defined", "told"),
    [
        ("majorant", ["at_tentative"], ""),
        ("majorant", ["begin", "at_tentative"], ""),
        ("cells", ["begin", "step"], ""),
        ("majorant", ["begin", "step", "at_tentative"], f"{BOTH}begin and step and at_tentative"),
        ("majorant", ["step", "at_tentative"], f"{BOTH}step and at_tentative"),
        ("majorant", ["begin"], f"{BOTH}begin"),
        ("majorant", ["step"], f"{BOTH}step"),
        ("majorant", [], f"{BOTH}none"),
        ("cells", ["at_tentative"], "needs: [majorant], and no control, for at_tentative"),
        ("majorant, control", ["at_tentative"], "needs: [majorant], and no control"),
    ],
)
def test_the_functions_that_a_tracker_must_define(tmp_path, needs, defined, told):
    text = f"/*---\ntitle: x\n{FRONT}\nneeds: [{needs}]\n---*/\n/* void step(Path *path) {{}} */\n"
    text += "".join(f"static void {name}(Path *path)\n{{\n}}\n" for name in defined)
    if told:
        assert complaints(tmp_path, text).startswith("mine.cl:1:1: expected ")
        assert told in complaints(tmp_path, text)
    else:
        assert load_one(tmp_path, text).trackers["mine"].code.strip()


def test_a_tracker_of_old_that_shares_lookups_is_told_how_to(tmp_path):
    said = complaints(tmp_path, tracker_text(f"{FRONT}\nshares_lookup: true"))
    assert said.startswith(
        "mine.cl:4:16: shares_lookup: expected no such key any more; leave it out"
    )
    assert "defines at_tentative in place of step" in said


@pytest.mark.parametrize(
    "text",
    [
        "",
        "static void step(void) {}\n",
        "/* a comment */\n" + tracker_text(FRONT),
        "/*---\ntitle: x\n",
        "int i;\n" + tracker_text(FRONT),
    ],
)
def test_no_front_matter(tmp_path, text):
    said = complaints(tmp_path, text)
    assert said == "mine.cl:1:1: expected front matter, /*--- ... ---*/, as the first comment"


def test_empty_front_matter(tmp_path):
    said = complaints(tmp_path, "/*---\n---*/\n")
    assert said == "mine.cl:1:1: expected title and estimands in the front matter, got nothing"


@pytest.mark.parametrize("name", ["residual-ratio", "2nd", "a b", "float", "_x", "größe"])
def test_names_that_are_no_identifiers(tmp_path, name):
    said = complaints(tmp_path, tracker_text(FRONT), name)
    assert said == f"{name}.cl:1:1: expected a C identifier as the file's name, got '{name}'"


def test_a_name_may_be_used_once(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.cl").write_text(tracker_text(FRONT))
    with pytest.raises(CatalogError) as caught:
        catalog.load([tmp_path / "a", tmp_path / "b"], builtin=False)
    first, second = tmp_path / "a" / "mine.cl", tmp_path / "b" / "mine.cl"
    assert str(caught.value) == (
        f"{second}:1:1: expected a new name, got 'mine' again (first in {first})"
    )
    # the same folder twice is no conflict
    assert catalog.load([tmp_path / "a", tmp_path / "a"], builtin=False).trackers


def test_a_name_of_freepaths_own_is_taken(tmp_path):
    (tmp_path / "delta.cl").write_text(tracker_text(FRONT))
    with pytest.raises(CatalogError, match="got 'delta' again"):
        catalog.load([tmp_path])


def test_all_bad_files_at_once(tmp_path):
    (tmp_path / "good.cl").write_text(tracker_text(FRONT))
    (tmp_path / "one.cl").write_text("")
    (tmp_path / "two.cl").write_bytes(b"/*---\ntitle: \xff\n---*/")
    with pytest.raises(CatalogError) as caught:
        catalog.load([tmp_path, tmp_path / "nowhere"], builtin=False)
    said = str(caught.value)
    assert "one.cl:1:1: expected front matter" in said
    assert "two.cl:2:8: expected text in UTF-8, got the byte 0xff" in said
    assert "nowhere: expected a folder with .cl files, got none" in said
    assert "good.cl" not in said


def test_a_folder_with_no_tracker_is_a_mistake(tmp_path):
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(CatalogError, match="expected a folder with .cl files, got none"):
        catalog.load([tmp_path])
