from freepath.errors import ConfigError, Problem, did_you_mean


def test_a_problem_without_a_line_names_the_file_alone():
    assert str(Problem("-a lanes=3", 0, 0, "lanes", "wrong")) == "-a lanes=3: lanes: wrong"


def test_a_long_line_is_cut_around_the_caret():
    line = "x" * 3000 + "HERE" + "x" * 3000
    place, shown, caret = str(Problem("f", 1, 3001, "", "wrong", line)).splitlines()
    assert len(shown) < 120
    assert shown[caret.index("^") :].startswith("HERE")


def test_tabs_and_escapes_do_not_move_the_caret():
    _, shown, caret = str(Problem("f", 1, 5, "", "m", "\ta\x1b\tHERE")).splitlines()
    assert shown[caret.index("^") :] == "HERE"
    assert shown.isprintable()


def test_did_you_mean():
    assert did_you_mean("trackr", ["medium", "tracker"]) == "; did you mean 'tracker'?"
    assert did_you_mean("DELTA", ["delta"]) == "; did you mean 'delta'?"
    assert did_you_mean("xyz", ["delta", "ratio"]) == ""
    assert did_you_mean("x", []) == ""


def test_a_config_error_shows_all_problems():
    error = ConfigError([Problem("f", 0, 0, "", "one"), Problem("f", 0, 0, "", "two")])
    assert str(error) == "f: one\nf: two"
    assert error.exit_code == 2
