"""A result in Python: its cases as a table, which of them is the fastest, and its charts."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from freepath.errors import FreepathError, NothingMatchedError, did_you_mean, expect
from freepath.results.folder import Row, records
from freepath.show import answers, report, table
from freepath.show.markdown import html_table
from freepath.show.report.data import read_summary
from freepath.show.report.text import HEADER, cells, sentences

COLUMNS = (
    "case", "status", "tracker_label", "majorant", "tightness", "lookups_per_sample",
    "time_per_sample_s", "lane_occupancy", "variance", "bias_rms", "time_to_1pct_s",
    "time_to_1pct_noise",
)  # fmt: skip
"""What `cases` has; the last is half the 95 % interval of the time to 1 %, relative to it."""


class Ratio(NamedTuple):
    """How many times as fast one case is as another to an accuracy, with the 95 % interval."""

    times: float
    low: float
    high: float
    one: answers.Case
    other: answers.Case

    def __str__(self) -> str:
        """As a sentence has it."""
        times = answers.times_as_fast(self.other, self.one)
        return f"{self.one.name} is {times} as {self.other.name}"


@dataclass(frozen=True)
class Result:
    """The folder of a run, or the cases of it that were chosen by `only`."""

    folder: Path
    including: str = ""
    """A regular expression that names of cases match."""

    def only(self, expression: str) -> Result:
        """The cases whose name matches a regular expression, as -R has it."""
        expect("only", _compiled(expression), "a regular expression", expression)
        found = Result(self.folder, expression)
        if not (found.including and any(one in self.rows for one in found.rows)):
            raise NothingMatchedError(f"only: no case of {self.folder} matches {expression!r}")
        return found

    @cached_property
    def rows(self) -> list[Row]:
        """Its rows of summary.csv as they stand there, texts."""
        rows = read_summary(self.folder)
        return [row for row in rows if re.search(self.including, row["case"])]

    @property
    def summary(self) -> Any:
        """All columns of summary.csv, a row per case (docs/notation.md), as a DataFrame.

        Numbers are floats or integers, infinite where a bias stands in the way; unknown cells are
        None or NaN. Without pandas a list of dictionaries.
        """
        return frame(records(self.rows))

    @property
    def cases(self) -> Any:
        """A dozen columns, the fastest to 1 % of each question first, without what was skipped."""
        rows = [row for group in table.groups(self.rows) for row in sorted(group, key=table.rank)]
        found = []
        for row, texts in zip(records(rows), rows, strict=True):
            one = answers.case_of(texts)
            found.append({**row, "time_to_1pct_noise": one and one.noise})
        return frame([{name: row[name] for name in COLUMNS} for row in found])

    def best(self, accuracy: float = 0.01) -> answers.Case:
        """The fastest case to a relative RMSE.

        Raises FreepathError where it is not known, no case reaches it, or several questions are
        asked: `only` chooses one.
        """
        found = self._at(accuracy, self._one_question())
        known = answers.leading(found)
        if known is None:
            raise FreepathError(answers.sentence(found, accuracy))
        return known[0][0]

    def ratio(self, one: str, other: str, accuracy: float = 0.01) -> Ratio:
        """How many times as fast `one` is as `other` to a relative RMSE, each at its best.

        Both are the name of a tracker, its label, or a regular expression that names of cases
        match. Raises FreepathError where that is not known, as `best` does.
        """
        first, second = (self._fastest(name, accuracy) for name in (one, other))
        return Ratio(*answers.ratio(second, first), first, second)

    def _fastest(self, name: str, accuracy: float) -> answers.Case:
        rows = self._one_question()
        expect("ratio", _compiled(name), "a tracker or a regular expression", name)
        named = [row for row in rows if name in (row["tracker"], row["tracker_label"], row["case"])]
        named = named or [row for row in rows if re.search(name, row["case"])]
        if not named:
            hint = did_you_mean(name, {row["tracker"] for row in rows})
            raise NothingMatchedError(f"ratio: no case has the name or matches {name!r}{hint}")
        reaching = self._at(accuracy, named)
        known = answers.leading(reaching)
        if known is None:
            why = "never reaches it" if not reaching else "its variance is not settled"
            raise FreepathError(f"ratio: not known at {100 * accuracy:g} %: {name!r}: {why}")
        return known[0][0]

    def _at(self, accuracy: float, rows: Iterable[Row]) -> list[answers.Case]:
        fits = isinstance(accuracy, (int, float)) and 0 < accuracy < 1
        expect("accuracy", fits, "a relative RMSE such as 0.01", accuracy)
        return [one for one in (answers.at_accuracy(row, accuracy) for row in rows) if one]

    def _one_question(self) -> list[Row]:
        asked = table.groups(self.rows)
        if len(asked) != 1:
            named = "; ".join(f"{row['estimand']} of {row['medium']}" for row, *_ in asked)
            what = f"{len(asked)} questions ({named}); choose one by result.only(...)"
            raise FreepathError(f"{self.folder}: expected one question and device, got {what}")
        return asked[0]

    @property
    def sentences(self) -> list[str]:
        """What it answers at 1 %, a sentence per question and device."""
        return sentences(self._report)

    @property
    def _report(self) -> report.Report:
        return report.load([self.folder], self.including)

    def chart(self, name: str = "cost", **options: Any) -> Any:
        """A chart by its name, as an altair.Chart; docs/report.md names them.

        `options` are `width`, of a panel in pixels, and `titled`.
        """
        from freepath.show.report.pictures import picture

        return picture(self._report, name, **options)

    def __len__(self) -> int:
        """How many cases it has."""
        return len(self.rows)

    def __repr__(self) -> str:
        """Where it is, how large, and what it answers."""
        return "\n".join([f"Result of {len(self)} cases in {self.folder}", *self.sentences])

    def _repr_html_(self) -> str:
        found = self._report
        told = "".join(f"<p>{html.escape(line)}</p>" for line in sentences(found))
        return told + html_table(HEADER, [cells(row) for row in found.rows])


def frame(found: list[dict[str, Any]]) -> Any:
    """Records as a pandas.DataFrame; as they are where pandas is missing."""
    found = [{k: float("inf") if v == "inf" else v for k, v in one.items()} for one in found]
    try:
        import pandas
    except ImportError:
        return found
    return pandas.DataFrame(found)


def _compiled(expression: Any) -> bool:
    try:
        return isinstance(expression, str) and re.compile(expression) is not None
    except re.error:
        return False
