"""OpenCL C files: front matter and code, and what the package's own files need to be composed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache

from freepath.config.document import Document
from freepath.paths import KERNELS

Chosen = tuple[str, str, tuple[str, ...]]
"""(parameter, what was chosen, all that can be chosen), each a define of a tracker."""
CONTRACT = ("begin", "step", "at_tentative")
"""The functions by which a tracker is called."""
_ANSWERS = ("sampled_depth", "splat", "escape_through_depth")
"""What a tracker calls that is another thing for shadow rays, in light/shadow."""
_FUNCTION = re.compile(r"^(?!else\b)\w[\w\s*]*?\b(\w+)\s*\([^;{}]*\)\s*\{", re.MULTILINE)
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_ENDS = re.compile(r"\bpath\s*->\s*live\s*&?=[^=]|\b(collide|escape\w*)\s*\(")
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


def functions(code: str) -> set[str]:
    """The functions that code defines."""
    return set(_FUNCTION.findall(_COMMENT.sub(" ", code)))


def ended_in_begin(code: str) -> tuple[int, str] | None:
    """The line of `begin` at which it ends a path, and by what; None where it does not."""
    plain = _COMMENT.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), code)
    found = next((one for one in _FUNCTION.finditer(plain) if one[1] == "begin"), None)
    if not found:
        return None
    depth, end = 1, found.end()
    while depth and end < len(plain):
        depth += {"{": 1, "}": -1}.get(plain[end], 0)
        end += 1
    ends = _ENDS.search(plain, found.end(), end)
    return (plain.count("\n", 0, ends.start()) + 1, ends[1] or "path->live") if ends else None


@dataclass(frozen=True)
class KernelFile:
    """One file: its name below kernels/, its code, and the two things that composing needs."""

    name: str
    code: str
    uses: tuple[str, ...] = ()
    state: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class TrackerFile:
    """A tracker as a source has it: its code, and what it declares."""

    name: str
    code: str
    needs: frozenset[str] = frozenset()
    numbers: tuple[str, ...] = ()
    choices: tuple[Chosen, ...] = ()
    state: tuple[tuple[str, str], ...] = ()
    uses: tuple[str, ...] = ()
    aims: bool = False
    """Whether it chooses directions with the light in mind."""

    @property
    def at_tentative(self) -> bool:
        """Whether it decides at a tentative collision, and leaves its step to the walk."""
        return "at_tentative" in functions(self.code)

    def files(self, role: str = "", *, step: bool = True) -> list[KernelFile]:
        """Its file and what it leaves to the walk, `step` not always; named as flight or shadow."""
        own = functions(self.code)
        left = {"walk/begin": "begin" not in own, "walk/step": step} if self.at_tentative else {}
        files = [KernelFile(f"trackers/{self.name}.cl", self.code)]
        files += [read(name) for name, there in left.items() if there]
        if not role:
            return files
        names = "|".join({*CONTRACT, *own, *(_ANSWERS if role == "shadow" else ())})
        called = re.compile(rf"(?<![.>])\b({names})(?=\s*\()")
        return [replace(f, code=self._as(role, called.sub(rf"{role}_\1", f.code))) for f in files]

    def _as(self, role: str, code: str) -> str:
        if role != "shadow":
            return code
        for name, _, _ in self.choices:
            code = re.sub(rf"\b{name.upper()}(_\w+)?\b", r"SHADOW_\g<0>", code)
        return re.sub(r"->tracker\b", "->shadow_tracker", code)

    def defines(self, prefix: str = "") -> Iterator[str]:
        """Its choices, each a define."""
        for parameter, chosen, choices in self.choices:
            name = prefix + parameter.upper()
            yield from (f"#define {name}_{c.upper()} {i}" for i, c in enumerate(choices))
            yield f"#define {name} {name}_{chosen.upper()}"


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
    text = (KERNELS / f"{name}.cl").read_text("utf-8")
    front, code = split_front_matter(text)
    keys = Document.parse(f"{name}.cl", front or "").data or {}
    return KernelFile(f"{name}.cl", code, tuple(keys.get("uses", ())), keys.get("state") or {})
