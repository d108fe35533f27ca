"""Data flows one way: no part imports one to its right, and only what needs OpenCL loads it."""

import ast
from pathlib import Path

import pytest

import freepath

FOLDER = Path(freepath.__file__).parent
ORDER = (
    "__init__",
    "errors",
    "paths",
    "config",
    "compose",
    "cases",
    "scene",
    "device",
    "results",
    "measure",
    "show",
    "api",
    "checks",
    "extras",
    "commands",
    "cli",
    "__main__",
)
"""Each part may import those above it: docs/decisions/module-order.md."""
PLACE = {name: place for place, name in enumerate(ORDER)}
OPENCL = {"device/opencl.py", "measure/runner.py"}
ONLY_CSV = {
    # the pictures of a run are files beside its CSV; the ladder is arithmetic on a row
    "show/report": {"__init__", "errors", "results", "show", "measure.pictures", "measure.ladder"},
    "show/compare": {"errors", "results", "show"},
    "show/table.py": {"errors"},
    "results": {"errors", "results"},
}
"""What may be imported by what works on rows of CSV and on nothing else."""


def modules(below=""):
    found = FOLDER / below
    return [found] if found.is_file() else sorted(found.rglob("*.py"))


def named(path):
    return path.relative_to(FOLDER).as_posix()


def part(path):
    """The part of freepath that a file belongs to."""
    return path.relative_to(FOLDER).with_suffix("").parts[0]


def imports(path):
    """What a file imports: whole names, with the line each is in; not what only types need."""
    tree = ast.parse(path.read_text("utf-8"))
    for_types = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if id(node) in for_types:
            continue
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}:{node.lineno}: a relative import"
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


def own_imports(path):
    """What a file imports of freepath: the names behind `freepath.`, and their lines."""
    for name, line in imports(path):
        package, _, rest = name.partition(".")
        if package == "freepath":
            yield (rest if rest.split(".")[0] in PLACE else "__init__"), line


def test_every_part_has_its_place():
    assert {part(path) for path in modules()} == set(PLACE)


@pytest.mark.parametrize("path", modules(), ids=named)
def test_no_module_imports_one_to_its_right(path):
    own = part(path)
    for name, line in own_imports(path):
        of = name.split(".")[0]
        assert of == own or PLACE[of] < PLACE[own], f"{path}:{line}: {own} imports {name}"


def test_opencl_is_where_it_belongs():
    users = {named(path) for path in modules() if "pyopencl" in {n for n, _ in imports(path)}}
    assert users == OPENCL


@pytest.mark.parametrize(("below", "allowed"), ONLY_CSV.items())
def test_what_is_shown_of_results_comes_from_csv(below, allowed):
    assert modules(below)
    for path in modules(below):
        for name, line in own_imports(path):
            known = any(name == one or name.startswith(f"{one}.") for one in allowed)
            assert known, f"{path}:{line}: {name}"


def test_what_a_report_needs_of_measure_needs_no_opencl():
    """No module of measure that a report may use reaches one that calls OpenCL."""
    allowed = [name for name in ONLY_CSV["show/report"] if name.startswith("measure.")]
    files = [f"{name.replace('.', '/')}.py" for name in allowed]
    seen, left = set(), [name for name in files if (FOLDER / name).is_file()]
    while left:
        name = left.pop()
        seen.add(name)
        for found, _ in own_imports(FOLDER / name):
            files = [f"{'/'.join(found.split('.')[:n])}.py" for n in (1, 2, 3)]
            left += [file for file in files if (FOLDER / file).is_file() and file not in seen]
    assert len(seen) > 1
    assert not seen & OPENCL


@pytest.mark.parametrize("folder", sorted({part(p) for p in modules() if p.parent != FOLDER}))
def test_each_part_says_at_its_head_what_lives_there(folder):
    text = ast.get_docstring(ast.parse((FOLDER / folder / "__init__.py").read_text("utf-8")))
    said, empty, *more = text.splitlines()
    assert said
    assert not empty
    assert len(more) >= 2  # what lives there, and what may be touched


def test_a_wrong_import_would_be_found(tmp_path):
    wrong = tmp_path / "errors.py"
    wrong.write_text("def f():\n    from freepath.device.opencl import Device\n")
    assert list(own_imports(wrong)) == [("device.opencl.Device", 2)]
    wrong.write_text("import freepath.cli\nfrom freepath import extras, __version__\n")
    assert list(own_imports(wrong)) == [("cli", 1), ("extras", 2), ("__init__", 2)]
