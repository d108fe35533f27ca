import pytest

from freepath.config.overrides import parse_all
from freepath.errors import ConfigError

GOOD = "name: x\nmatrix:\n  medium: {homogeneous: {sigma_t: 1}}\n  tracker: delta\n"


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("tightness=1,2,4", [1, 2, 4]),
        ("tightness=1", [1]),
        ("tightness=[1, 2]", [1, 2]),
        (" tightness = 1e-3", [0.001]),
        ("tracker=delta,{march: {step: 0.01}}", ["delta", {"march": {"step": 0.01}}]),
        ("medium=cloud: {resolution: 8}", [{"cloud": {"resolution": 8}}]),
        ("lanes=auto,16", ["auto", 16]),
    ],
)
def test_values_are_yaml(text, values):
    (override,) = parse_all([text]).values()
    assert override.values == values


def test_an_override_replaces_an_axis(load_text):
    loaded = load_text(GOOD + "  tightness: broken\n", ["tightness=1,2,4", "lanes=8"])
    assert loaded.matrix.tightness == (1.0, 2.0, 4.0)
    assert loaded.matrix.lanes == (8,)
    assert loaded.overridden == {"tightness", "lanes"}


def test_an_override_stands_in_for_what_is_required(load_text):
    assert load_text("name: x\n", ["tracker=delta", "medium={linear: {bottom: 1, top: 2}}"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tightness=1,x", "tightness[1]: expected a number > 0, got 'x'"),
        ("tightness=[1,x]", "tightness[1]: expected a number > 0, got 'x'"),
        ("tightness=", "tightness: expected at least one value, got an empty list"),
        ("tightness", "expected AXIS=VALUE[,VALUE...]"),
        ("tightnes=1", "unknown axis 'tightnes'; did you mean 'tightness'?"),
        ("seed=1", "unknown axis 'seed'; expected one of estimand, medium"),
        ("=1", "unknown axis ''; expected one of estimand, medium"),
        ("tightness=[1,2", "tightness: not valid YAML"),
        ("tightness=1]", "tightness: not valid YAML"),
        ("tightness={a: 1, a: 2}", "tightness[0].a: expected a key once"),
        (
            "tracker=delta,dleta",
            "tracker[1]: expected a tracker, got 'dleta'; did you mean 'delta'?",
        ),
        ("tracker={march: {stp: 1}}", "tracker[0].stp: unknown key; did you mean 'step'?"),
        ("medium=cloud", "medium[0].resolution: expected an integer from 2 to 1024, got nothing"),
        ("lanes=\x01", "lanes: expected text, got the character U+0001"),
    ],
)
def test_mistakes_in_overrides(load_text, text, message):
    with pytest.raises(ConfigError) as caught:
        load_text(GOOD, [text])
    assert str(caught.value).startswith(f"-a {text}: {message}")
    assert "\n" not in str(caught.value)


def test_mistakes_of_all_overrides_at_once():
    with pytest.raises(ConfigError) as caught:
        parse_all(["lanes=1", "tightnes=1", "lanes=2", "x"])
    assert len(caught.value.problems) == 3
    assert "-a lanes=2: lanes: expected an axis once, got it again" in str(caught.value)


def test_mistakes_in_file_and_override_are_shown_together(load_text):
    with pytest.raises(ConfigError) as caught:
        load_text(GOOD + "seed: x\n", ["lanes=3"])
    assert "x.yaml:5:7: seed" in str(caught.value)
    assert "-a lanes=3: lanes[0]: expected" in str(caught.value)


@pytest.mark.parametrize("matrix", ["3", "[1]", ""])
def test_an_override_of_what_is_no_matrix(load_text, matrix):
    with pytest.raises(ConfigError, match="matrix"):
        load_text(f"name: x\nmatrix: {matrix}\n", ["lanes=4"])
