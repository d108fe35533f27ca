"""What docs point at is there: links, headings, files, commands and their flags, libraries."""

import configparser
import re
from pathlib import Path

import pytest

from freepath import cli

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
PAGES += [ROOT / "kernels" / "README.md", *sorted(ROOT.glob("docs/**/*.md"))]
FOLDERS = ("harness", "kernels", "configs", "tests", "docs", "packaging", ".ci")
CONCEPTS = sorted(path.name for path in (ROOT / "kernels").iterdir() if path.is_dir())
LINK = re.compile(r"\]\(([^)\s]+)\)")
FILE = re.compile(rf"(?<![\w/.])(?:{'|'.join(map(re.escape, FOLDERS))})/[\w./*-]*[\w*]")
KERNEL = re.compile(rf"`((?:{'|'.join(CONCEPTS)})/[\w.-]+)`")
INVENTED = re.compile(r"Say it is called `(\w+)`")


def anchors(text):
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)", text, re.MULTILINE)
    return [re.sub(r"[^\w -]", "", one.strip().lower()).replace(" ", "-") for one in headings]


def missing(page, text):
    """What a page points at and is not there."""
    for link in LINK.findall(text):
        name, _, anchor = link.partition("#")
        to = page.parent / name if name else page
        if re.match(r"\w+:", link):
            continue
        if not to.exists() or (anchor and anchor not in anchors(to.read_text("utf-8"))):
            yield link
    invented = INVENTED.findall(text)
    for name in FILE.findall(LINK.sub("]", text)):
        if not any(one in name for one in invented) and not any(ROOT.glob(name)):
            yield name
    for name in KERNEL.findall(text):
        # KIND and NAME stand for any; a part may be named without its ending
        if not any(
            (ROOT / "kernels").glob(re.sub("KIND|NAME", "*", name.removesuffix(".cl")) + ".cl")
        ):
            yield name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_points_at_is_there(page):
    assert list(missing(page, page.read_text("utf-8"))) == []


@pytest.mark.parametrize(
    "text",
    [
        "[a page](docs/nothing.md)",
        "[a heading](docs/devices.md#no-such-heading)",
        "in `harness/table.py` and elsewhere",
        "    python tests/nothing.py",
        "by `media/nothing.cl`",
        "[a heading of this page](#nothing)",
    ],
)
def test_what_is_not_there_is_found(text):
    assert len(list(missing(ROOT / "README.md", text))) == 1


COMMAND = re.compile(r"(?:^ {4,}|[`&(;] ?|bin/)freepath ((?:[a-z]+\b)[^`\n#;&)]*)", re.MULTILINE)
(SUBPARSERS,) = [
    action.choices for action in cli.parser()._actions if getattr(action, "dest", "") == "command"
]


def unknown(text):
    """Commands of a text that freepath does not have, and flags that they do not take."""
    for said in COMMAND.findall(text):
        name, *words = said.split()
        if name not in SUBPARSERS:
            yield name
            continue
        flags = {flag for action in SUBPARSERS[name]._actions for flag in action.option_strings}
        for word in re.findall(r"(?<![\w-])--?[A-Za-z][\w-]*", " ".join(words)):
            if word not in flags:
                yield f"{name} {word}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_of_a_page_can_be_run(page):
    assert list(unknown(page.read_text("utf-8"))) == []


def test_each_command_is_in_the_readme():
    text = (ROOT / "README.md").read_text("utf-8")
    assert {said.split()[0] for said in COMMAND.findall(text)} == set(SUBPARSERS)


@pytest.mark.parametrize(
    "text", ["    freepath fly\n", "`freepath run --speed`", "`freepath try -N`"]
)
def test_a_command_that_is_none_is_found(text):
    assert len(list(unknown(text))) == 1


def test_each_library_has_its_line_in_the_readme():
    parsed = configparser.ConfigParser()
    parsed.read(ROOT / "setup.cfg")
    lists = [parsed["options"]["install_requires"], *parsed["options.extras_require"].values()]
    names = set(re.findall(r"^([\w.-]+)[>=]", "\n".join(lists), re.MULTILINE))
    rows = re.findall(r"^\| ([\w., ;-]+?)(?: \(.*?\))? \|", (ROOT / "README.md").read_text(), re.M)
    assert len(names) > 20
    assert names <= {name for row in rows for name in re.split("[,;] ", row)}
