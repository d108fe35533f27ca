"""The test of the tests: planted defects, each with the check that must catch it.

`python -m freepath.check.defects [DEVICE [PART]]` plants each whose description has the part, and
prints the table of docs/defects.md.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from freepath import catalog
from freepath.check import registry
from freepath.check.model import LEVEL, Check
from freepath.check.planted import KERNELS, Defect
from freepath.check.planted_host import HOST, HostDefect, planted
from freepath.check.planted_numbers import NUMBERS
from freepath.check.planted_paths import PATHS
from freepath.check.rig import Change, Rig
from freepath.check.verdict import Failure
from freepath.errors import FAILED
from freepath.selection import one_device

DEFECTS: tuple[Defect | HostDefect, ...] = KERNELS + NUMBERS + PATHS + HOST


def caught(rig: Rig, defect: Defect | HostDefect, check: Check) -> str:
    """What the check says of the changed program; '' where it finds nothing wrong.

    Raises LookupError where the check uses nothing with a place for the defect.
    """
    try:
        if isinstance(defect, HostDefect):
            with planted(defect) as function:
                check.run(rig.without_scenes(), LEVEL)
            used = function.called
        else:
            change = Change(defect.old, defect.new)
            check.run(rig.with_change(change), LEVEL)
            used = bool(change.planted)
    except Failure as failure:
        return str(failure)
    if not used:
        raise LookupError(f"{check.name} builds nothing with a place for '{defect.what}'")
    return ""


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
