import contextlib
import random
import re

import pytest

from freepath import config
from freepath.errors import ConfigError

GOOD = """\
name: x
rays: orthographic
matrix:
  medium: {homogeneous: {sigma_t: 1}}
  tracker: delta
"""


def complaints(load, text, overrides=()):
    with pytest.raises(ConfigError) as caught:
        load(text, overrides)
    return str(caught.value)


def matrix(lines):
    """Return a config with these lines in its matrix, which begins in line 4."""
    keys = {line.split(":")[0] for line in lines.splitlines() if line[:1].strip()}
    if "medium" not in keys:
        lines += "\nmedium: {homogeneous: {sigma_t: 1}}"
    if "tracker" not in keys:
        lines += "\ntracker: delta"
    return "name: x\nseed: 7\nmatrix:\n" + "\n".join("  " + line for line in lines.splitlines())


def test_the_example_of_the_design(load_text):
    text = "name: x\n\n\n\n\n\n\nmatrix:\n  medium: {homogeneous: {sigma_t: 1}}\n  majorant:\n"
    text += "    - global\n    - grid: {resolution: 8x}\n  tracker: delta\n"
    assert complaints(load_text, text) == (
        "x.yaml:12:26: matrix.majorant[1].resolution: expected an integer >= 1, got '8x'\n"
        "        - grid: {resolution: 8x}\n"
        "                             ^"
    )


def test_defaults(load_text):
    loaded = load_text(GOOD.replace("rays: orthographic\n", ""))
    assert loaded.seed == 1
    assert loaded.rays.as_dict() == {
        "orthographic": {"resolution": [64, 64], "direction": [0.0, 0.0, 1.0]}
    }
    assert loaded.matrix.estimand == ("transmittance",)
    assert [kind.as_dict() for kind in loaded.matrix.majorant] == [{"global": {}}]
    assert loaded.matrix.tightness == (1.0,)
    assert (loaded.matrix.lanes, loaded.matrix.arithmetic) == (("auto",), ("strict",))
    assert loaded.stop.model_dump() == {
        "error": 0.01,
        "time_noise": 0.02,
        "at_most": 10.0,
        "samples": None,
        "rounds": 10,
    }
    assert (loaded.include, loaded.exclude, loaded.description) == ((), (), None)
    assert str(loaded.path) == "x.yaml"
    assert loaded.text.startswith("name: x")


EVERY_KIND = """\
name: every.kind-1
description: All there is
seed: 18446744073709551615
rays: {perspective: {resolution: 32, position: [0, 0, -3 m], look_at: [0, 0, 0]}}
matrix:
  estimand: [transmittance, free_path, mean_extinction]
  medium:
    - homogeneous: {sigma_t: 0.5/km, size: 2 km}
    - linear: {bottom: 0, top: 3}
    - exponential: {sigma_t: 5, scale_height: 0.3, size: [1, 1, 4]}
    - gaussian: {sigma_t: 5, width: 0.2}
    - gaussian: {sigma_t: 5, width: 0.2, center: [0.1, 0.2, -0.3]}
    - cosine: {sigma_t: 5, amplitude: 50%, periods: 2.5, phase: -1}
    - layered: {breakpoints: [0.2, 0.5], values: [1, 0, 3]}
    - layered: {breakpoints: 0.5, values: [1, 0]}
    - layered: {breakpoints: 5, values: [1, 0], size: [1, 1, 9]}
    - cloud: {resolution: 64, seed: 3, sigma_t: 200, interpolation: nearest}
    - volume: {file: a b.vdb, grid: density, voxel_size: [20 m, 20 m, 40 m]}
    - volume: {file: c.npy, voxel_size: 2, sigma_t: 1/km}
  majorant: [global, global: , {grid: {resolution: 8}}, {grid: {resolution: [8, 8, 16]}}]
  tightness: [0.25, 1, 1e3]
  tracker: [delta, march, {march: {step: 5 cm, placement: jittered, order: 2}}, {exact: }]
  lanes: [auto, 1, 2, 4, 8, 16]
  arithmetic: [strict, fast, double]
include:
  - {tracker: delta, tightness: [5, 6], medium: {cloud: {resolution: 8}}}
exclude:
  tracker: [delta, {march: {step: 0.01}}]
  medium: [cloud, {layered: {values: [1, 0]}}]
stop: {error: 0.5%, time_noise: 0.02, at_most: 500 ms}
"""


def test_every_kind_loads_and_loads_again_from_what_it_holds(load_text, small_catalog):
    loaded = load_text(EVERY_KIND)
    media = loaded.matrix.medium
    assert media[0].parameters() == {
        "sigma_t": pytest.approx(5e-4),
        "size": (2000.0, 2000.0, 2000.0),
        "channels": None,
        "albedo": (0.0,),
        "emission": (0.0,),
        "phase": "henyey_greenstein",
        "g": 0.0,
        "alpha": 1.0,
    }
    assert "alpha" not in media[0].as_dict()["homogeneous"]  # or ids of cases would be others
    assert media[7].breakpoints == (0.5,)
    assert media[10].voxel_size == (20.0, 20.0, 40.0)
    assert media[5].amplitude == 0.5
    assert loaded.matrix.majorant[2].resolution == (8, 8, 8)
    assert loaded.matrix.tracker[2].as_dict() == {
        "march": {"step": 0.05, "placement": "jittered", "order": 2}
    }
    context = {"tracker": small_catalog.parameter_models()}
    again = config.Config.model_validate(loaded.as_dict(), context=context)
    assert again.as_dict() == loaded.as_dict()


@pytest.mark.parametrize(
    ("stop", "held"),
    [
        ("{samples: 1e6}", {"samples": 1_000_000, "rounds": 10}),
        ("{samples: 1e6, rounds: 20}", {"samples": 1_000_000, "rounds": 20}),
        ("{at_most: 500 ms}", {"error": 0.01, "time_noise": 0.02, "at_most": 0.5}),
        ("{at_most: 3, samples: }", {"error": 0.01, "time_noise": 0.02, "at_most": 3.0}),
    ],
)
def test_what_is_held_of_either_way_to_stop_loads_again(load_text, small_catalog, stop, held):
    loaded = load_text(GOOD + f"stop: {stop}\n")
    assert loaded.as_dict()["stop"] == held
    context = {"tracker": small_catalog.parameter_models()}
    assert config.Config.model_validate(loaded.as_dict(), context=context).stop == loaded.stop


@pytest.mark.parametrize(
    "rays",
    [
        "orthographic",
        "{orthographic: {resolution: [8, 16], direction: [1, 0, -2]}}",
        "{chords: {count: 1e4}}",
        "{single: {origin: [0, 0, -1 m], direction: [0, 0, 1]}}",
        "{file: {path: rays.csv}}",
    ],
)
def test_rays(load_text, rays):
    assert load_text(GOOD.replace("orthographic", rays)).rays.kind in rays


def test_commented_out_entries_leave_nothing(load_text):
    loaded = load_text(GOOD + "include:\n#  - {lanes: 4}\nexclude: []\n")
    assert (loaded.include, loaded.exclude) == ((), ())


# (the lines of the matrix, line and column of the caret, what is said); the matrix begins in line 4
BAD_MATRIX = [
    ("tightness: x", 4, 14, "matrix.tightness: expected a number > 0, got 'x'"),
    ("tightness: [1, 2, x]", 4, 21, "matrix.tightness[2]: expected a number > 0, got 'x'"),
    ("tightness: [1, yes]", 4, 18, "matrix.tightness[1]: expected a number > 0, got 'yes'"),
    ("tightness: true", 4, 14, "matrix.tightness: expected a number > 0, got true"),
    ("tightness: 0", 4, 14, "matrix.tightness: expected a number > 0, got 0"),
    ("tightness: .nan", 4, 14, "matrix.tightness: expected a number > 0, got nan"),
    ("tightness: -.inf", 4, 14, "matrix.tightness: expected a number > 0, got -inf"),
    ("tightness: 1e999", 4, 14, "matrix.tightness: expected a number > 0, got inf"),
    ("tightness: 10%", 4, 14, "matrix.tightness: expected a number > 0, got '10%'"),
    ("tightness: 2 m", 4, 14, "matrix.tightness: expected a number > 0, got '2 m'"),
    ("tightness: '2'", 4, 14, "got '2' (a text: write it without quotes)"),
    ("tightness:", 4, 3, "matrix.tightness: expected a number > 0, got nothing"),
    ("tightness: []", 4, 14, "matrix.tightness: expected at least one value, got an empty list"),
    ("tightness: [[1]]", 4, 15, "matrix.tightness[0]: expected a number > 0, got a list of 1"),
    ("tightness: {a: 1}", 4, 14, "matrix.tightness: expected a number > 0, got a mapping"),
    ("tightness: 2024-01-01", 4, 14, "expected a number > 0, got '2024-01-01'"),
    ("tightnes: 1", 4, 3, "matrix.tightnes: unknown key; did you mean 'tightness'?"),
    ("foo: 1", 4, 3, "matrix.foo: unknown key; expected one of estimand, medium, majorant"),
    ("lanes: 3", 4, 10, "matrix.lanes: expected one of auto, 1, 2, 4, 8, 16, got 3"),
    ("lanes: true", 4, 10, "matrix.lanes: expected one of auto, 1, 2, 4, 8, 16, got true"),
    ("lanes: [1, '4']", 4, 14, "matrix.lanes[1]: expected one of auto, 1, 2, 4, 8, 16, got '4'"),
    ("lanes: atuo", 4, 10, "got 'atuo'; did you mean 'auto'?"),
    ("arithmetic: Fast", 4, 15, "expected one of strict, fast, double, got 'Fast'; did you mean"),
    ("estimand: transmitance", 4, 13, "got 'transmitance'; did you mean 'transmittance'?"),
    ("tracker: dleta", 4, 12, "matrix.tracker: expected a tracker, got 'dleta'; did you mean"),
    ("tracker: zzz", 4, 12, "expected a tracker (one of cells, delta, exact, march), got 'zzz'"),
    ("tracker: 3", 4, 12, "expected a tracker (one of cells, delta, exact, march), got 3"),
    ("tracker: {dleta: }", 4, 13, "matrix.tracker: expected a tracker, got 'dleta'; did you mean"),
    ("tracker: {delta: {x: 1}}", 4, 21, "matrix.tracker.x: unknown key; expected none"),
    ("tracker: {delta: 3}", 4, 20, "matrix.tracker: expected nothing more, got 3"),
    ("tracker: {march: {stp: 1}}", 4, 21, "matrix.tracker.stp: unknown key; did you mean 'step'?"),
    ("tracker: {march: {step: 0}}", 4, 27, "matrix.tracker.step: expected a length > 0"),
    ("tracker: {march: {step: 1 s}}", 4, 27, "matrix.tracker.step: expected a length > 0"),
    ("tracker: {march: {order: 4}}", 4, 28, "expected an integer from 1 to 3, got 4"),
    ("tracker: {march: {order: 1 m}}", 4, 28, "expected an integer from 1 to 3, got '1 m'"),
    (
        "tracker: [delta, {march: {placement: midpint}}]",
        4,
        40,
        "matrix.tracker[1].placement: expected one of start, midpoint, jittered, got 'midpint'; "
        "did you mean 'midpoint'?",
    ),
    ("medium: clod", 4, 11, "matrix.medium: expected a medium, got 'clod'; did you mean 'cloud'?"),
    ("medium: fog", 4, 11, "expected a medium (one of homogeneous, linear, exponential"),
    ("medium: {}", 4, 11, "matrix.medium: expected a medium (one of homogeneous"),
    (
        "medium: cloud",
        4,
        11,
        "matrix.medium.resolution: expected an integer from 2 to 1024, got no",
    ),
    ("medium:\n  - cloud:", 5, 7, "matrix.medium[0].resolution: expected an integer from 2"),
    (
        "medium:\n  - cloud:\n    resolution: 3",
        5,
        7,
        "expected a medium as a single key, got 2 keys; indent 'resolution' deeper than 'cloud'",
    ),
    ("medium: {cloud: 1, volume: 2}", 4, 11, "matrix.medium: expected a medium as a single key"),
    (
        "medium: {homogeneous: {sigma_t: 1, phase: rayleigh, g: 0.5}}",
        4,
        58,
        "matrix.medium.g: expected no g with phase: rayleigh, got 0.5",
    ),
    (
        "medium: {cloud: {resolution: 8, channels: [1]}}",
        4,
        45,
        "channels: expected a list of 2 to 32 numbers, got a list of 1",
    ),
    ("medium: {cloud: {resolution: 8, channels: [1, -1]}}", 4, 49, "a number >= 0, got -1"),
    ("medium: {cloud: {resolution: 8, channels: red}}", 4, 45, "got 'red'"),
    ("medium: {cloud: [1]}", 4, 19, "expected a mapping with resolution, channels, albedo"),
    ("medium: [[cloud]]", 4, 12, "matrix.medium[0]: expected a medium (one of"),
    ("medium: {cloud: {resolution: 1}}", 4, 32, "expected an integer from 2 to 1024, got 1"),
    ("medium: {cloud: {resolution: 8.5}}", 4, 32, "expected an integer from 2 to 1024, got 8.5"),
    ("medium: {cloud: {resolution: true}}", 4, 32, "an integer from 2 to 1024, got true"),
    ("medium: {cloud: {resolution: 8, sead: 1}}", 4, 35, "unknown key; did you mean 'seed'?"),
    ("medium: {cloud: {resolution: 8, kind: x}}", 4, 35, "matrix.medium.kind: unknown key"),
    ("medium: {cloud: {resolution: 8, seed: -1}}", 4, 41, "expected an integer from 0 to"),
    ("medium: {homogeneous: {sigma_t: -1}}", 4, 35, "matrix.medium.sigma_t: expected an extinct"),
    ("medium: {homogeneous: {sigma_t: 5 m}}", 4, 35, "matrix.medium.sigma_t: expected an extinct"),
    ("medium: {homogeneous: {sigma_t: 1, size: 0}}", 4, 44, "matrix.medium.size: expected a leng"),
    (
        "medium: {homogeneous: {sigma_t: 1, size: [1, 1]}}",
        4,
        44,
        "matrix.medium.size: expected one number or a list [x, y, z], got a list of 2",
    ),
    ("medium: {homogeneous: {sigma_t: 1, size: [1, 1, 1, 1]}}", 4, 44, "got a list of 4"),
    ("medium: {homogeneous: {sigma_t: 1, size: [1, 0, 1]}}", 4, 48, "matrix.medium.size[1]: expe"),
    ("medium: {homogeneous: {sigma_t: 1, size: {x: 1}}}", 4, 44, "matrix.medium.size: expected"),
    ("medium: {cosine: {sigma_t: 1, amplitude: 2, periods: 1}}", 4, 44, "a fraction from 0 to 1"),
    ("medium: {gaussian: {sigma_t: 1, width: 1, center: 0.5}}", 4, 53, "expected a list [x, y, z]"),
    (
        "medium: {layered: {breakpoints: [0.5, 0.4], values: [1, 2, 3]}}",
        4,
        35,
        "matrix.medium.breakpoints: expected heights that are ascending, got 0.5 before 0.4",
    ),
    (
        "medium: {layered: {breakpoints: [0.5, 1], values: [1, 2, 3]}}",
        4,
        35,
        "expected heights that are below the top of the box at 1, got 1 before 1",
    ),
    (
        "medium: {layered: {breakpoints: [0.5], values: [1, 2, 3]}}",
        4,
        50,
        "matrix.medium.values: expected 2 values (one more than breakpoints), got a list of 3",
    ),
    ("medium: {volume: {file: 3}}", 4, 27, "matrix.medium.file: expected a file name, got 3"),
    ("medium: {volume: {file: ' '}}", 4, 27, "matrix.medium.file: expected a file name, got ' '"),
    ("medium: {volume: {file: a, interpolation: cubic}}", 4, 45, "expected trilinear or nearest"),
    (
        "majorant: grid",
        4,
        13,
        "matrix.majorant.resolution: expected one number or a list [x, y, z]",
    ),
    ("majorant: {grid: {resolution: 0}}", 4, 33, "matrix.majorant.resolution: expected an integer"),
    ("majorant: {grid: {resolution: [8, 8]}}", 4, 33, "one number or a list [x, y, z], got a list"),
    (
        "majorant: {grid: {resolution: 1000}}",
        4,
        33,
        "expected at most 134217728 cells, got 1000000",
    ),
    ("majorant: {global: {a: 1}}", 4, 23, "matrix.majorant.a: unknown key; expected none"),
]


@pytest.mark.parametrize(("lines", "line", "column", "message"), BAD_MATRIX)
def test_mistakes_in_the_matrix(load_text, lines, line, column, message):
    text = matrix(lines)
    said = complaints(load_text, text).splitlines()
    assert said[0].startswith(f"x.yaml:{line}:{column}: ")
    assert message in said[0]
    # one mistake is one problem, and its caret is under what is wrong
    assert len(said) == 3
    assert said[1] == "    " + text.splitlines()[line - 1]
    assert said[2] == " " * (4 + column - 1) + "^"


BAD_TOP = [
    ("", 0, 0, "expected a mapping with name and matrix, got an empty file"),
    ("# nothing\n", 0, 0, "expected a mapping with name and matrix, got an empty file"),
    ("- 1\n", 1, 1, "expected a mapping with name, description, seed, rays, matrix"),
    ("just a text\n", 1, 1, "expected a mapping with name"),
    ("3\n", 1, 1, "expected a mapping with name"),
    ("\x7fELF", 1, 1, "expected text, got the character U+007F"),
    (GOOD.replace("name: x\n", ""), 1, 1, "name: expected a name of letters"),
    (GOOD.replace("name: x", "name: a/b"), 1, 7, "name: expected a name of letters"),
    (GOOD.replace("name: x", "name: 3"), 1, 7, "name: expected a name of letters"),
    (GOOD.replace("name: x", "name:"), 1, 1, "expected a name of letters, digits, '.', '_' and '-"),
    (GOOD.replace("name: x", "nam: x"), 1, 1, "nam: unknown key; did you mean 'name'?"),
    ("name: x\n", 1, 1, "matrix: expected a mapping with estimand, medium"),
    ("name: x\nmatrix: 3\n", 2, 9, "matrix: expected a mapping with estimand"),
    ("name: x\nmatrix:\n", 2, 1, "matrix: expected a mapping with estimand"),
    ("name: x\nmatrix: {tracker: delta}\n", 2, 9, "matrix.medium: expected a medium (one of homog"),
    (
        GOOD.replace("  tracker: delta\n", ""),
        4,
        3,
        "matrix.tracker: expected a tracker, got nothin",
    ),
    (GOOD + "matrx: 1\n", 6, 1, "matrx: unknown key; did you mean 'matrix'?"),
    (GOOD + "seed: 1.5\n", 6, 7, "seed: expected an integer from 0 to 18446744073709551615, got"),
    (GOOD + "seed: 18446744073709551616\n", 6, 7, "got 18446744073709551616"),
    (GOOD + "description: 3\n", 6, 14, "description: expected a text, got 3"),
    (GOOD + "stop: 3 s\n", 6, 7, "stop: expected a mapping with error, time_noise, at_most"),
    (GOOD + "stop: {error: 1 s}\n", 6, 15, "stop.error: expected a fraction > 0 and <= 1"),
    (GOOD + "stop: {error: 0}\n", 6, 15, "stop.error: expected a fraction > 0 and <= 1"),
    (GOOD + "stop: {at_most: 3 m}\n", 6, 17, "stop.at_most: expected a time > 0, such as 10 or 10"),
    (
        GOOD + "stop: {samples: 0}\n",
        6,
        17,
        "stop.samples: expected an integer from 2 to 1000000000000, got 0",
    ),
    (GOOD + "stop: {rounds: 20}\n", 6, 8, "stop.rounds: expected beside samples alone, which it"),
    (GOOD + "stop: {at_most: 1, samples: 9}\n", 6, 8, "stop.at_most: expected without samples, of"),
    (GOOD + "stop: {samples: 9, error: 1%}\n", 6, 20, "stop.error: expected without samples, of"),
    (GOOD + "stop: {samples: 9,\n  time_noise: 1}\n", 7, 3, "stop.time_noise: expected without s"),
    (GOOD + "stop: {at_least: 1}\n", 6, 8, "stop.at_least: unknown key; did you mean 'at_most'?"),
    (GOOD + "include: 3\n", 6, 10, "include: expected a mapping with estimand, medium"),
    (GOOD + "include: [{}]\n", 6, 11, "include[0]: expected at least one axis, got an empty mapp"),
    (GOOD + "include: {tightness: 0}\n", 6, 22, "include.tightness: expected a number > 0, got 0"),
    (GOOD + "include: [{medium: cloud}]\n", 6, 20, "include[0].medium.resolution: expected an int"),
    (GOOD + "include: [{lanes: }]\n", 6, 12, "include[0].lanes: expected one of auto, 1, 2"),
    (GOOD + "exclude: [{}]\n", 6, 11, "exclude[0]: expected at least one axis, got an empty mapp"),
    (
        GOOD + "exclude: [{tracker: dlta}]\n",
        6,
        21,
        "exclude[0].tracker: expected a tracker, got 'd",
    ),
    (GOOD + "exclude: [{medium: {cloud: {seed: a}}}]\n", 6, 35, "exclude[0].medium.seed: expected"),
    (GOOD + "exclude: [{medium: {cloud: {sead: 1}}}]\n", 6, 29, "exclude[0].medium.sead: unknown"),
    (GOOD.replace("orthographic", "chords"), 2, 7, "rays.count: expected an integer from 1"),
    (GOOD.replace("orthographic", "[chords]"), 2, 7, "rays: expected rays (one of orthographic"),
    (GOOD.replace("orthographic", "ortographic"), 2, 7, "got 'ortographic'; did you mean 'orthogr"),
    (
        GOOD.replace("orthographic", "{single: {origin: [0, 0, 0], direction: [0, 0, 0]}}"),
        2,
        47,
        "rays.direction: expected a direction that is not zero, got [0, 0, 0]",
    ),
    (
        GOOD.replace("orthographic", "{perspective: {position: [0, 0, 1], look_at: [0, 0, 1]}}"),
        2,
        52,
        "rays.look_at: expected a point other than position",
    ),
    (GOOD.replace("orthographic", "{orthographic: {resolution: 5000}}"), 2, 35, "from 1 to 4096"),
]


@pytest.mark.parametrize(("text", "line", "column", "message"), BAD_TOP)
def test_mistakes_outside_the_matrix(load_text, text, line, column, message):
    said = complaints(load_text, text)
    place = f"x.yaml:{line}:{column}: " if line else "x.yaml: "
    assert any(found.startswith(place) and message in found for found in said.splitlines()), said


def test_all_mistakes_at_once_in_the_order_of_the_text(load_text):
    text = (
        "nam: x\nmatrix:\n  lanes: 3\n  medium: [clod, fog]\n  tracker: delta\nstop: {error: 2}\n"
    )
    places = re.findall(r"^x\.yaml:(\d+):(\d+)", complaints(load_text, text), re.MULTILINE)
    assert places == [("1", "1"), ("1", "1"), ("3", "10"), ("4", "12"), ("4", "18"), ("6", "15")]


def test_messages_hold_no_word_of_pydantic(load_text):
    for lines, *_ in BAD_MATRIX:
        said = complaints(load_text, matrix(lines))
        for word in (
            "Input",
            "pydantic",
            "function-",
            "tuple[",
            "ValidationError",
            "extra_forbidden",
        ):
            assert word not in said


def test_a_mistake_in_an_alias_is_shown_where_it_is_written(load_text):
    text = GOOD + "include:\n  - {tightness: &t [0]}\n  - {tightness: *t}\n"
    said = complaints(load_text, text)
    assert said.count("expected a number > 0, got 0") == 2
    assert said.count("x.yaml:7:21: ") == 2


# fmt: off
JUNK = (
    "x", "3", "[", "]", "{", "}", ":", "- ", "'", "&a", "*a", "!t ", "\t", "\n", "~", ".nan",
    "%", "#",
)
VALUES = ("~", "true", "0", "-1", "1.5", "1e400", "''", "[]", "{}", "[[]]", "{a: 1}", "[1, 2, 3]")
# fmt: on


@pytest.mark.parametrize("seed", range(20))
def test_damaged_configs_are_refused_or_load_but_never_break(load_text, seed):
    generator = random.Random(seed)
    for _ in range(10):
        text = EVERY_KIND
        for _ in range(generator.randint(1, 4)):
            place = generator.randrange(len(text))
            text = text[:place] + generator.choice(JUNK) + text[place + generator.randint(0, 6) :]
        with contextlib.suppress(ConfigError):
            load_text(text)


@pytest.mark.parametrize("seed", range(10))
def test_values_of_any_type_in_any_place_are_refused_or_load(load_text, seed):
    generator = random.Random(seed)
    # whatever stands after a colon, up to the next comma or bracket
    places = [found.span(1) for found in re.finditer(r": ([^\s,{}\[\]]+)", EVERY_KIND)]
    for _ in range(10):
        start, end = generator.choice(places)
        try:
            load_text(EVERY_KIND[:start] + generator.choice(VALUES) + EVERY_KIND[end:])
        except ConfigError as error:
            assert all(problem.line and problem.message for problem in error.problems)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"name: x\nmatrix: \xff\n", "x.yaml:2:9: expected text in UTF-8, got the byte 0xff"),
        (b"\xff\xfea\x00", "x.yaml:1:1: expected text in UTF-8"),
        (b"a\x00b", "x.yaml:1:2: expected text, got the character U+0000"),
        (b"\x93NUMPY" + b"\x00" * 100, "x.yaml:1:1: expected text in UTF-8, got the byte 0x93"),
        (b"a" * (1 << 20) + b"\n", "x.yaml: expected a text of at most 1 MiB, got a larger file"),
    ],
)
def test_files_that_are_no_text(tmp_path, monkeypatch, content, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.yaml").write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        config.load("x.yaml", {})
    assert str(caught.value).splitlines()[0].startswith(message)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("no.yaml", "no.yaml: expected a file, got nothing there"),
        (".", ".: expected a file, got a directory"),
        ("a\0b", "cannot be read"),
        ("x" * 5000, "cannot be read: File name too long"),
        ("x.yaml/y", "cannot be read: Not a directory"),
    ],
)
def test_paths_that_cannot_be_read(tmp_path, monkeypatch, path, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.yaml").write_text("")
    with pytest.raises(ConfigError) as caught:
        config.load(path, {})
    assert message in str(caught.value)


@pytest.mark.parametrize("prefix", [b"\xef\xbb\xbf", b""])
def test_a_byte_order_mark_and_windows_lines_are_read(tmp_path, small_catalog, prefix):
    file = tmp_path / "x.yaml"
    file.write_bytes(prefix + GOOD.replace("\n", "\r\n").encode())
    assert config.load(file, small_catalog.parameter_models()).name == "x"


def test_find_takes_files_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert config.find("quick").parent != tmp_path
    (tmp_path / "quick").mkdir()
    assert config.find("quick") == config.shipped()["quick"]
    (tmp_path / "quick.yaml").write_text("name: mine")
    assert config.find("quick.yaml").read_text() == "name: mine"


def test_find_names_what_there_is(tmp_path):
    (tmp_path / "quick.yaml").write_text("")
    (tmp_path / "lanes.yaml").write_text("")
    (tmp_path / "schema.json").write_text("")
    assert config.find("lanes", tmp_path) == tmp_path / "lanes.yaml"
    assert config.find("lanes.yaml", tmp_path) == tmp_path / "lanes.yaml"
    with pytest.raises(ConfigError) as caught:
        config.find("qick.yaml", tmp_path)
    assert str(caught.value) == (
        "qick.yaml: expected a config file or the name of one that comes with freepath"
        " (lanes, quick); did you mean 'quick'?"
    )
    for name in ("x" * 5000, "a\0b", ""):
        with pytest.raises(ConfigError):
            config.find(name, tmp_path)


def test_find_leaves_a_folder_to_load(tmp_path):
    assert config.find(tmp_path) == tmp_path
    with pytest.raises(ConfigError, match="got a directory"):
        config.load(config.find(tmp_path), {})


def test_of_unknown_keys_the_first_are_told(load_text):
    with pytest.raises(ConfigError) as error:
        load_text(GOOD + "".join(f"k{i}: 1\n" for i in range(4000)))
    assert [problem.line for problem in error.value.problems] == list(range(6, 106))


@pytest.mark.parametrize("samples", ["9e21", "1000000000001", "9007199254740993"])
def test_samples_that_would_never_end(load_text, samples):
    with pytest.raises(
        ConfigError, match="stop.samples: expected an integer from 2 to 10000000000"
    ):
        load_text(GOOD + f"stop: {{samples: {samples}}}\n")


def test_a_grid_without_a_name_can_be_asked_for(load_text):
    text = GOOD.replace("{homogeneous: {sigma_t: 1}}", "{volume: {file: a.vdb, grid: ''}}")
    assert text != GOOD
    (medium,) = load_text(text).matrix.medium
    assert medium.grid == ""
