"""What docs point at is there: links, headings, files."""

import re
from pathlib import Path

import pytest

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
