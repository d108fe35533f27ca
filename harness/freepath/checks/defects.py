"""The test of the tests: planted defects, each with the check that must catch it.

`python -m freepath.checks.defects [DEVICE [PART]]` plants each whose description has the part, and
prints the table of docs/defects.md.
"""

from __future__ import annotations

import inspect
import sys
import tempfile
import textwrap
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, NamedTuple
from unittest import mock

from ruamel.yaml import YAML

from freepath.checks import registry
from freepath.checks.model import LEVEL, Check
from freepath.checks.rig import Change, Rig
from freepath.checks.verdict import Failure
from freepath.compose import catalog
from freepath.device.selection import one_device
from freepath.errors import FAILED


class Defect(NamedTuple):
    """A slip of a hand: what it is, a piece of the source and what is in its place, who sees it."""

    what: str
    old: str
    new: str
    check: str
    function: str = ""
    """Of the host, as module.name where it is looked up; '' for the source of a kernel."""


def _read() -> tuple[Defect, ...]:
    text = resources.files("freepath.checks").joinpath("planted.yaml").read_text("utf-8")
    found = []
    for entry in YAML(typ="safe").load(text):
        what, check = next(iter(entry.items()))
        found.append(Defect(what, entry["old"], entry["new"], check, entry.get("in", "")))
    return tuple(found)


DEFECTS = _read()


def caught(rig: Rig, defect: Defect, check: Check) -> str:
    """What the check says of the changed program; '' where it finds nothing wrong.

    Raises LookupError where the check uses nothing with a place for the defect.
    """
    change = Change(defect.old, defect.new)
    try:
        if defect.function:
            wrong = _changed(resolve_name(defect.function), change)
            with mock.patch(defect.function, side_effect=wrong, autospec=True) as patched:
                check.run(rig.without_scenes(), LEVEL)
            used = patched.called
        else:
            check.run(rig.with_change(change), LEVEL)
            used = bool(change.planted)
    except Failure as failure:
        return str(failure)
    if not used:
        raise LookupError(f"{check.name} builds nothing with a place for '{defect.what}'")
    return ""


def _changed(function: Callable[..., Any], change: Change) -> Callable[..., Any]:
    """The function made of its changed text."""
    names = dict(function.__globals__)
    exec(change.apply(textwrap.dedent(inspect.getsource(function))), names)
    if not change.planted:
        raise LookupError(f"{function.__qualname__} has no place for {change.old!r}")
    return names[function.__name__]


def main(arguments: Sequence[str]) -> int:
    """Plant each defect on a device and print who caught it; 8 where one was missed."""
    known = catalog.load()
    checks = {check.name: check for check in registry.checks(known)}
    print("| planted defect | caught by | which said |\n| --- | --- | --- |")
    missed = 0
    with tempfile.TemporaryDirectory(prefix="freepath-defects-") as folder:
        rig = Rig(one_device(list(arguments[:1])), known, Path(folder))
        for defect in DEFECTS:
            if not all(part in defect.what for part in arguments[1:]):
                continue
            said = caught(rig, defect, checks[defect.check])
            missed += not said
            text = said.splitlines()[0].replace("|", "\\|") if said else "**nothing: missed**"
            print(f"| {defect.what} | `{defect.check}` | {text} |", flush=True)
    return FAILED if missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
