"""A comparison of two sides, for the command line and for Python."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

from freepath.errors import FreepathError
from freepath.show.compare import showing
from freepath.show.compare.judging import Judged, Settings, compare
from freepath.show.compare.pairing import Side, refuse, unpaired
from freepath.show.markdown import html_table


@dataclass(frozen=True)
class Comparison:
    """A contender judged case by case against a reference; ratios are contender / reference."""

    reference: Side
    contender: Side
    settings: Settings
    judged: list[Judged]
    shifts: dict[Any, tuple[float, float]]
    """Of each scene, what all its cases changed by together, and how much of it was taken out."""

    @property
    def cases(self) -> Any:
        """A row per case with its verdict, as a DataFrame, or a list of dictionaries."""
        from freepath.show.result import frame

        return frame([showing.record(one) for one in self.judged])

    @property
    def verdicts(self) -> Counter[str]:
        """How many cases got each verdict."""
        return Counter(one.verdict for one in self.judged)

    def lines(self, *, everything: bool = False, cases: bool = True) -> list[str]:
        """What the command line says; of cases those that are not the same, or all."""
        told = showing.lines(self.judged, everything=everything) if cases else []
        told += showing.shift_lines(self.shifts)
        told.append(f"{self.contender.name}: {showing.totals(self.judged)}")
        return [*told, *filter(None, [showing.undecided(self.judged, self.settings.to_show)])]

    def __str__(self) -> str:
        """The same in one text."""
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        return html_table(showing.HEADER, [showing.cells(one) for one in self.judged])


def comparison(
    reference: Side, contender: Side, settings: Settings, other_machine: bool = False
) -> Comparison:
    """Compare two sides; raises FreepathError where that should not be done, with the reason."""
    names = f"{reference.name} and {contender.name}"
    if reason := unpaired(reference, contender):
        raise FreepathError(f"{names}: {reason}")
    if not other_machine and (reason := refuse(reference, contender)):
        raise FreepathError(f"{names}: {reason}; --other-machine compares them anyway")
    return Comparison(reference, contender, settings, *compare(reference, contender, settings))
