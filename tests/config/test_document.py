import time

import pytest

from freepath.config.document import Document, path_text
from freepath.errors import ConfigError


def problems(text):
    with pytest.raises(ConfigError) as caught:
        Document.parse("x.yaml", text)
    return caught.value.problems


def test_reads_yaml_1_2():
    text = "a: 1e-3\nb: on\nc: 010\nd: [1, yes, ~, true]\ne: 2024-01-01\nf: 0x10\n"
    assert Document.parse("x", text).data == {
        "a": 0.001,
        "b": "on",
        "c": 10,
        "d": [1, "yes", None, True],
        "e": "2024-01-01",
        "f": 16,
    }


def test_anchors_and_merges():
    text = "base: &b {x: 1, y: 2}\nmore:\n  <<: *b\n  y: 3\nagain: [*b]\n"
    document = Document.parse("x", text)
    assert document.data["more"] == {"x": 1, "y": 3}
    assert document.data["again"] == [{"x": 1, "y": 2}]
    # what is merged in stands where its anchor is, what replaces it stands in the mapping
    assert document.problem(("more", "x"), "m").line == 1
    assert document.problem(("more", "y"), "m").line == 4


@pytest.mark.parametrize("text", ["", "\n\n", "# only a comment\n", "---\n"])
def test_an_empty_text_has_no_data(text):
    assert Document.parse("x", text).data is None


@pytest.mark.parametrize(
    ("text", "line", "column", "message"),
    [
        ("a: 1\n\tb: 2\n", 2, 1, "expected spaces, got a tab: here it is read in quotes only"),
        ("a:\n\t- 1\n", 2, 1, "expected spaces, got a tab: here it is read in quotes only"),
        ("a: b: c\n", 1, 5, "not valid YAML: mapping values are not allowed here"),
        ("a: [1, 2\nb: 3\n", 2, 2, "not valid YAML: expected ',' or ']'"),
        ("a: 'x\n", 1, 4, "what opens here is not closed"),
        ("a: *nope\n", 1, 4, "not valid YAML: found undefined alias 'nope'"),
        ("a: 1\n---\nb: 2\n", 2, 1, "expected a single YAML document, got another one"),
        ("- a\nb: 1\n", 2, 1, "not valid YAML"),
        ("a: \x01\n", 1, 4, "expected text, got the character U+0001"),
        ("a: 1\nb: 2\na: 3\n", 3, 1, "a: expected a key once, got it again (first in line 1)"),
        ("a: {b: 1, b: 2}\n", 1, 11, "a.b: expected a key once"),
        ("a: 1\n3: 2\n", 2, 1, "expected a name as key, got '3'"),
        ("a: 1\n'': 2\n", 2, 1, "expected a name as key, got ''"),
        ("a: 1\n[x]: 2\n", 2, 1, "expected a name as key, got a list or mapping"),
        ("a: !foo 3\n", 1, 4, "a: expected a plain value, got the tag '!foo'"),
        ("a: !!set {x}\n", 1, 4, "a: expected a plain value, got the tag"),
        ("a: !!binary eA==\n", 1, 4, "a: expected a plain value, got the tag"),
        ("a: !!int x\n", 1, 4, "a: expected a value, got 'x'"),
        ("a: !!float x\n", 1, 4, "a: expected a value, got 'x'"),
        ("a: !!bool x\n", 1, 4, "a: expected a value, got 'x'"),
        ("a: " + "1" * 5000 + "\n", 1, 4, "a: expected a value, got '1111"),
        ("a: &x [*x]\n", 1, 4, "a[0]: expected a value, got an alias that contains itself"),
        ("a: 1\n<<: 3\n", 2, 5, "expected a mapping, or a list of them, to merge"),
        ("a: " + "[" * 4000, 0, 0, "nested too deeply"),
    ],
)
def test_mistakes_of_form(text, line, column, message):
    first = problems(text)[0]
    assert (first.line, first.column) == (line, column)
    assert message in f"{first.path}: {first.message}"


def test_all_mistakes_of_form_at_once():
    found = problems("a: 1\na: 2\nb: {c: 1, c: 2}\n? 4\n: x\n")
    assert [problem.line for problem in found] == [2, 4, 3]


def test_nested_aliases_do_not_explode():
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 30)]
    assert len(Document.parse("x", "\n".join(lines)).data["a29"]) == 10


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_lines_are_counted_as_editors_do(ending):
    # U+2028 is a line break to YAML 1.1 alone
    document = Document.parse("x", f"a: 'x\u2028y'{ending}b: 2{ending}")
    problem = document.problem(("b",), "m")
    assert (problem.line, problem.column, problem.source_line) == (2, 4, "b: 2")


def test_the_caret_stands_under_the_value():
    document = Document.parse("x.yaml", "a:\n  - {b: 1, c: [2, 33]}\n")
    assert str(document.problem(("a", 0, "c", 1), "wrong")) == (
        "x.yaml:2:19: a[0].c[1]: wrong\n      - {b: 1, c: [2, 33]}\n" + " " * 22 + "^"
    )


def test_path_text():
    assert path_text(("matrix", "medium", 1, "size", 0)) == "matrix.medium[1].size[0]"
    assert path_text(("a b", "c\x1b")) == "'a b'.'c\\x1b'"


@pytest.mark.parametrize("text", ["!!int ''", "!!float ''", "!!float _", "!!int '-'", "!!int 0x"])
def test_tags_whose_value_is_none(text):
    with pytest.raises(ConfigError, match="x.yaml:1:4: a: expected a value, got"):
        Document.parse("x.yaml", f"a: {text}\n")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("version", "column"), [("1.1", 7), ("1.3", 7), ("2.0", 7)])
def test_another_version_of_yaml(version, column):
    wanted = f"x.yaml:1:{column}: expected YAML 1.2, got '{version}': leave the line out"
    with pytest.raises(ConfigError, match=wanted):
        Document.parse("x.yaml", f"%YAML {version}\n---\na: yes\n")
    assert Document.parse("x.yaml", "%YAML 1.2\n---\na: yes\n").data == {"a": "yes"}


def bomb(levels):
    text = "a0: &a0 {k: 1, j: 2}\n"
    for level in range(1, levels):
        sources = ", ".join([f"*a{level - 1}"] * 9)
        text += f"a{level}: &a{level} {{<<: [{sources}], own: {level}}}\n"
    return text


def test_merging_what_merges_is_linear():
    started = time.process_time()
    data = Document.parse("x.yaml", bomb(20)).data
    assert time.process_time() - started < 2
    assert data["a19"] == {"k": 1, "j": 2, "own": 19}


def test_which_of_several_values_merging_takes():
    text = "a: &a {x: 1, y: 1}\nb: &b {x: 2, z: 2}\nc: {<<: [*a, *b], y: 3}\nd: {y: 4, <<: *b}\n"
    data = Document.parse("x.yaml", text).data
    assert data["c"] == {"x": 1, "y": 3, "z": 2}
    assert data["d"] == {"x": 2, "z": 2, "y": 4}


def test_merging_is_bounded_where_it_copies_much():
    base = "base: &b {" + ", ".join(f"k{i}: 1" for i in range(500)) + "}\n"
    with pytest.raises(ConfigError, match=r"merging \(<<\) copies more than 20000 keys"):
        Document.parse("x.yaml", base + "".join(f"m{i}: {{<<: *b}}\n" for i in range(50)))


@pytest.mark.parametrize("value", ["*x", "[*x]"])
def test_merging_a_mapping_into_itself(value):
    with pytest.raises(ConfigError, match="expected a mapping, or a list of them, to merge"):
        Document.parse("x.yaml", f"a: &x {{<<: {value}}}\n")


@pytest.mark.parametrize(
    "text", ["".join(f"k{i}: 1\n" for i in range(60_000)), "k: 1\n" * 100_000, "[" + "x," * 99_999]
)
def test_more_than_anybody_writes_is_refused_at_once(text):
    started = time.process_time()
    with pytest.raises(ConfigError, match="x.yaml: expected at most 20000 keys, values and lines"):
        Document.parse("x.yaml", text)
    assert time.process_time() - started < 1


def test_of_many_problems_the_first_are_told():
    with pytest.raises(ConfigError) as error:
        Document.parse("x.yaml", "k: 1\n" * 3000)
    assert [problem.line for problem in error.value.problems] == list(range(2, 102))
