"""OpenCL C files: front matter and code, and what the package's own files need to be composed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources

from freepath.config.document import Document

CONTRACT = ("begin", "step", "at_tentative")
"""The functions by which a tracker is called."""
_ANSWERS = ("sampled_depth", "splat", "escape_through_depth")
"""What a tracker calls that is another thing for shadow rays, in effects/shadow."""
_FUNCTION = re.compile(r"^(?!else\b)\w[\w\s*]*?\b(?P<name>\w+)\s*\([^;{}]*\)\s*\{", re.MULTILINE)
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
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


def functions(code: str) -> dict[str, int]:
    """The functions that code defines, and the line of each."""
    bare = _COMMENT.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), code)
    places = {found["name"]: found.start("name") for found in _FUNCTION.finditer(bare)}
    return {name: bare.count("\n", 0, place) + 1 for name, place in places.items()}


@dataclass(frozen=True)
class KernelFile:
    """One file: its name below kernels/, its code, and what composing needs."""

    name: str
    code: str
    uses: tuple[str, ...] = ()
    state: dict[str, str] = field(default_factory=dict)
    held: dict[str, str] = field(default_factory=dict)

    def called(self, role: str, choices: Iterable[str] = ()) -> KernelFile:
        """The same as `flight` or as `shadow`: with the names that its functions have there.

        `choices`: the parameters of a shadow ray's tracker that are defines.
        """
        names = {*CONTRACT, *functions(self.code), *(_ANSWERS if role == "shadow" else ())}
        code = re.sub(rf"(?<![.>])\b({'|'.join(sorted(names))})(?=\s*\()", rf"{role}_\1", self.code)
        if role == "shadow":
            code = re.sub(r"->tracker\b", "->shadow_tracker", code)
            for name in map(str.upper, choices):
                code = re.sub(rf"\b{name}(_\w+)?\b", r"SHADOW_\g<0>", code)
        return replace(self, code=code)

    def completed(self, *, step: bool = True) -> list[KernelFile]:
        """A tracker's file and the parts of it that it leaves to the walk, `step` not always."""
        own = functions(self.code)
        if "at_tentative" not in own:
            return [self]
        left = {"walk/begin": "begin" not in own, "walk/step": step}
        return [self, *(read(name) for name, there in left.items() if there)]


def taken(kind: str, into: str, other: str) -> str:
    """A statement by which lanes `where` take over a value of this kind."""
    if kind in {"Vector", "Indices", "Ray", "Rng"}:
        return f"take_{kind.lower()}(&{into}, &{other}, where);"
    if kind == "spectrum":
        each = taken("real", f"{into}[c]", f"{other}[c]")
        return f"for (int c = 0; c < CHANNELS; ++c) {{ {each} }}"
    return f"{into} = choose(where, {other}, {into});"


@cache
def read(name: str) -> KernelFile:
    """Read `kernels/<name>.cl` of the package."""
    text = resources.files("freepath.kernels").joinpath(f"{name}.cl").read_text("utf-8")
    front, code = split_front_matter(text)
    keys = Document.parse(f"{name}.cl", front or "").data or {}
    uses, state = tuple(keys.get("uses", ())), keys.get("state") or {}
    return KernelFile(f"{name}.cl", code, uses, state, keys.get("held") or {})
