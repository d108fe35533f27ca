"""Comparisons of results: what became faster, slower, noisier or different, from CSV alone."""

from freepath.show.compare.judging import REGRESSIONS, VERDICTS, Judged, Settings, compare
from freepath.show.compare.pairing import Side, load, refuse, unpaired

__all__ = [
    "REGRESSIONS",
    "VERDICTS",
    "Judged",
    "Settings",
    "Side",
    "compare",
    "load",
    "refuse",
    "unpaired",
]
