"""Comparisons of results: what became faster, slower, noisier or different, from CSV alone."""

from freepath.compare.judging import VERDICTS, Judged, Settings, compare
from freepath.compare.pairing import Side, load, refuse

__all__ = ["VERDICTS", "Judged", "Settings", "Side", "compare", "load", "refuse"]
