"""OpenCL C files: front matter and code, and what the package's own files need to be composed."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache
from importlib import resources

from freepath.config.document import Document

_FRONT_MATTER = re.compile(
    r"\A\s*/\*---[ \t]*\n(?P<yaml>.*?)^[ \t]*---\*/(?:[ \t]*\n)?", re.DOTALL | re.MULTILINE
)


def split_front_matter(text: str) -> tuple[str | None, str]:
    """Split a kernel file into the YAML of its front matter (None if it has none) and its code.

    Both keep their line numbers: empty lines stand for what was before them.
    """
    found = _FRONT_MATTER.match(text)
    if not found:
        return None, text
    before = text.count("\n", 0, found.start("yaml"))
    whole = text.count("\n", 0, found.end())
    return "\n" * before + found["yaml"], "\n" * whole + text[found.end() :]


@dataclass(frozen=True)
class KernelFile:
    """One file: its name below kernels/, its code, and the two things that composing needs."""

    name: str
    code: str
    uses: tuple[str, ...] = ()
    state: dict[str, str] = field(default_factory=dict)


@cache
def read(name: str) -> KernelFile:
    """Read `kernels/<name>.cl` of the package."""
    text = resources.files("freepath.kernels").joinpath(f"{name}.cl").read_text("utf-8")
    front, code = split_front_matter(text)
    keys = Document.parse(f"{name}.cl", front or "").data or {}
    return KernelFile(f"{name}.cl", code, tuple(keys.get("uses", ())), keys.get("state") or {})
