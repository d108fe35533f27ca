"""The OpenCL C files of the package, each with what its front matter says."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache
from importlib import resources

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from freepath.errors import CatalogError

_FRONT_MATTER = re.compile(r"\A\s*/\*---\n(?P<yaml>.*?)^---\*/[ \t]*\n", re.DOTALL | re.MULTILINE)


def split_front_matter(text: str, name: str) -> tuple[dict, str]:
    """Split a kernel file into its front matter (empty if it has none) and its code.

    The code keeps its line numbers: the front matter is replaced by as many empty lines.
    Raises CatalogError where the front matter is no YAML mapping.
    """
    found = _FRONT_MATTER.match(text)
    if not found:
        return {}, text
    try:
        data = YAML(typ="safe", pure=True).load(found["yaml"])
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = text[: found.start("yaml")].count("\n") + (mark.line if mark else 0) + 1
        reason = getattr(error, "problem", None) or error
        raise CatalogError(f"{name}:{line}: front matter: {reason}") from error
    if not isinstance(data, dict):
        raise CatalogError(f"{name}: front matter: expected a mapping, got {data!r}")
    return data, "\n" * text[: found.end()].count("\n") + text[found.end() :]


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
    front, code = split_front_matter(text, f"{name}.cl")
    return KernelFile(f"{name}.cl", code, tuple(front.get("uses", ())), front.get("state") or {})
