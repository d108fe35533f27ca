"""Comparisons of results: what became faster, slower, noisier or different, from CSV alone."""

from freepath.show.compare.comparison import Comparison, comparison
from freepath.show.compare.judging import VERDICTS, Judged, Settings, compare
from freepath.show.compare.pairing import Side, load, on_device_of

__all__ = [
    "VERDICTS", "Comparison", "Judged", "Settings", "Side", "compare", "comparison", "load",
    "on_device_of",
]  # fmt: skip
