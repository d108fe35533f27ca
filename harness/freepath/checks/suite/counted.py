"""Lookups are counted: a tracker that reads the medium past the count looks cheaper than it is."""

from __future__ import annotations

import re

from freepath.checks.rig import Rig
from freepath.checks.suite.common import VOXELS, Checks, everyone, voxels
from freepath.checks.verdict import NotApplicable, demand
from freepath.compose.catalog import Tracker

COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.S)
UNCOUNTED = re.compile(r"\bsigma_t_at\s*\(|\bgather\s*\(\s*scene\b")
EXACT = frozenset(("closed_form", "cells"))
"""What gives optical depths without a lookup."""


checks = Checks()


@checks.each("lookups/counted", everyone, ("fast", "moments"))
def counted(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """What is read past the count of lookups makes a tracker look cheaper than it is: every one
    goes through sigma_t or sigma_t_at_tentative, which count."""
    for number, line in enumerate(COMMENT.sub(_blank, tracker.code).splitlines(), 1):
        found = UNCOUNTED.search(line)
        demand(
            not found,
            f"{tracker.path.name}:{number}: expected sigma_t or sigma_t_at_tentative, which count "
            f"lookups, got {found and found.group()}",
        )
    if tracker.needs & EXACT:
        raise NotApplicable("it takes optical depths from a formula or from cells")
    lookups = voxels(rig, tracker, VOXELS).record(256).round.counters["lookups"]
    demand(lookups > 0, "not one lookup counted in a medium that varies")


def _blank(comment: re.Match[str]) -> str:
    """As many lines without words, so that numbers of lines stay."""
    return "\n" * comment.group().count("\n")
