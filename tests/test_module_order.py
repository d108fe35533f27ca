"""Data flows one way: no module imports one to its right, and only what needs OpenCL loads it."""

import ast
from pathlib import Path

import freepath
import pytest

FOLDER = Path(freepath.__file__).parent
# Each line may import those above it and none of its own or below.
ORDER = (
    ("version",),
    ("__init__", "errors", "environment", "columns", "ladder"),
    ("config",),
    ("kernel_files",),
    ("catalog",),
    ("path_axes",),
    ("applicable", "effects", "listing"),
    ("plan",),
    ("scene", "source", "octree", "stats"),
    ("majorants",),
    ("stopping", "cpu_name", "icd", "compilers"),
    ("drivers",),
    ("device",),
    ("limits", "trial"),
    ("selection",),
    ("runner",),
    ("measure", "journal"),
    ("geometry",),
    ("reading",),
    ("results",),
    ("rows", "table", "markdown", "binding", "confirm", "pictures"),
    ("answers",),
    ("equal_time", "report", "compare"),
    ("jobs",),
    ("run_file",),
    ("sweep",),
    ("arguments", "device_setup"),
    ("api", "check"),
    ("candidate", "recommend"),
    ("commands",),
    ("cli",),
    ("__main__",),
)
PLACE = {name: place for place, names in enumerate(ORDER) for name in names}
LONGEST = 330
ONLY_CSV = {
    "table": {"errors"},
    "answers": {"table"},
    "markdown": set(),
    # the pictures of a run are files beside its CSV
    "report": {
        "answers",
        "errors",
        "ladder",
        "markdown",
        "pictures",
        "reading",
        "report",
        "results",
        "table",
        "version",
    },
    "compare": {"errors", "markdown", "reading", "results", "table", "compare"},
    "results": {"errors", "journal", "columns", "reading"},
    "reading": {"errors"},
    "journal": {"errors"},
}
"""What modules may import that work on rows of CSV and on nothing else."""


def modules():
    return sorted(FOLDER.rglob("*.py"))


def part(path):
    """The module or sub-package of freepath that a file belongs to."""
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
    """The parts of freepath that a file imports."""
    for name, line in imports(path):
        package, _, rest = name.partition(".")
        if package == "freepath":
            first = rest.split(".")[0]
            yield (first if first in PLACE else "__init__"), line


def test_every_module_has_its_place():
    parts = {part(path) for path in modules()}
    assert parts == set(PLACE)


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(FOLDER)))
def test_no_module_imports_one_to_its_right(path):
    own = part(path)
    for name, line in own_imports(path):
        assert name == own or PLACE[name] < PLACE[own], f"{path}:{line}: {own} imports {name}"


def reached(names):
    """All parts that these import, directly or not, themselves included."""
    found, left = set(), set(names)
    while left:
        name = left.pop()
        found.add(name)
        files = [path for path in modules() if part(path) == name]
        left |= {other for path in files for other, _ in own_imports(path)} - found
    return found


def test_left_of_the_device_nothing_needs_opencl():
    left = {name for name, place in PLACE.items() if place < PLACE["device"]}
    assert reached(left) <= left
    for path in modules():
        if part(path) in left | {"results", "table", "report", "compare", "arguments"}:
            assert not [name for name, _ in imports(path) if name.startswith("pyopencl")], path


def test_opencl_is_where_it_belongs():
    users = {part(path) for path in modules() if any(n == "pyopencl" for n, _ in imports(path))}
    assert users == {"device", "runner"}


@pytest.mark.parametrize(("name", "allowed"), ONLY_CSV.items())
def test_what_is_shown_of_results_comes_from_csv(name, allowed):
    files = [path for path in modules() if part(path) == name]
    assert files
    for path in files:
        assert {other for other, _ in own_imports(path)} <= allowed


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(FOLDER)))
def test_modules_are_short(path):
    assert len(path.read_text("utf-8").splitlines()) <= LONGEST


def test_a_wrong_import_would_be_found(tmp_path):
    wrong = tmp_path / "errors.py"
    wrong.write_text("def f():\n    from freepath.device import Device\n")
    assert list(own_imports(wrong)) == [("device", 2)]
    wrong.write_text("import freepath.cli\nfrom freepath import sweep, __version__\n")
    assert list(own_imports(wrong)) == [("cli", 1), ("sweep", 2), ("__init__", 2)]
