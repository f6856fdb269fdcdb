"""One thing that is said of a sheet, a plan or a study: how bad it is, of what, and in words."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

LEAST = 1e-300  # probability below which a double has no digits left
MOST_PARTS = 12  # single rows and runs of rows that a sentence names
MOST_ROWS_NAMED = 10  # rows that a sentence names one by one

Data = Mapping[str, Any]
Wording = Mapping[str, Callable[[Data], str]]


class Severity(IntEnum):
    """The consequence of a finding for the result."""

    NOTE = 0  # worth knowing
    WARNING = 1  # the result can be used, with care
    ALARM = 2  # do not use the result


# What explains residuals, and what says how large they are, or what came of them.
EXPLAIN = ("cause", "no_cause", "outliers", "known_contradicted")
SIZES = ("noise_above_sigma", "noise_estimated_large", "lack_of_fit", "outside", "far_below_zero")
VERDICTS = {Severity.NOTE: "good", Severity.WARNING: "usable", Severity.ALARM: "bad"}


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or looks wrong.

    Attributes:
        severity: Its consequence for the result.
        kind: A word for programs.
        words: One line: what is wrong, where, and what was done or is expected.
        data: What the words say, by name: numbers, units and circumstances; `rows` of the file or
            of the plan, counted from 0; `columns` of the file; names of `parameters`.
    """

    severity: Severity
    kind: str
    words: str
    data: Data = field(default_factory=dict)

    @classmethod
    def of(cls, severity: Severity, wording: Wording, kind: str, **data: Any) -> "Finding":
        """A finding in the words that a subject has for its kind.

        Args:
            severity: Its consequence for the result.
            wording: The sentences of the subject, by kind.
            kind: A word for programs.
            **data: What the sentence says.
        """
        return cls(severity, kind, wording[kind](data), data)

    @property
    def rows(self) -> tuple[int, ...]:
        """Rows of the file or of the plan, counted from 0."""
        return tuple(self.data.get("rows", ()))

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the file."""
        return tuple(self.data.get("columns", ()))

    def to_dict(self) -> dict[str, Any]:
        """Severity, kind and text; rows are counted from 1."""
        return {
            "severity": self.severity.name.lower(),
            "kind": self.kind,
            "text": self.words,
            "rows": [row + 1 for row in self.rows],
        }

    def __str__(self) -> str:
        """The words."""
        return self.words


def verdict(findings: Iterable[Finding]) -> str:
    """Whether to use a result: "good", "usable" or "bad", as the worst finding says."""
    return VERDICTS[max((one.severity for one in findings), default=Severity.NOTE)]


def worst_first(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings in the order in which a person reads them.

    The worst stand first; but what explains residuals stands before how large they are.
    """
    found = list(findings)
    sizes = [one.severity for one in found if one.kind in SIZES]

    def place(one: Finding) -> tuple[int, bool]:
        explains = one.kind in EXPLAIN
        severity = max([one.severity, *sizes]) if explains else one.severity
        return -severity, not explains

    return tuple(sorted(found, key=place))


def notes(findings: Iterable[Finding]) -> list[str]:
    """A line for each finding that does not keep from using the result."""
    return [f"note: {one.words}" for one in findings if one.severity is Severity.NOTE]


def leading_digit(value: float) -> str:
    """A standard deviation by its leading digit, without a power of ten: 60, 0.01."""
    return np.format_float_positional(float(f"{value:.1g}"), trim="-")


def shown_probability(p: float, digits: int = 2) -> str:
    """Write "= 0.015", or "< 1e-300" where a double would show a zero."""
    return f"= {p:.{digits}g}" if p > LEAST else f"< {LEAST:g}"


def row_names(rows: Sequence[int]) -> str:
    """Some rows, counted from 1, one by one: "row 5", or "rows 5, 6 and 12 more"."""
    return _listed([(str(row + 1), 1) for row in rows[:MOST_ROWS_NAMED]], len(rows))


def rows_in_words(rows: Sequence[int]) -> str:
    """Rows of a file, counted from 1, with runs: "row 3", "rows 3, 5 to 9 and 12 more"."""
    runs: list[list[int]] = []
    for row in sorted(rows):
        if runs and row == runs[-1][-1] + 1:
            runs[-1].append(row)
        else:
            runs.append([row])
    parts = [part for run in runs for part in _run_in_words(run)]
    return _listed(parts[:MOST_PARTS], len(rows))


def _listed(parts: Sequence[tuple[str, int]], count: int) -> str:
    """Words for rows, with how many rows each is of, and how many more there are."""
    more = count - sum(own for _, own in parts)
    listed = ", ".join(words for words, _ in parts) + (f" and {more} more" if more else "")
    return f"row{'s' * (count > 1)} {listed}"


def _run_in_words(run: list[int]) -> list[tuple[str, int]]:
    """Rows that follow each other, with how many rows each part of the words is of."""
    if len(run) > 2:
        return [(f"{run[0] + 1} to {run[-1] + 1}", len(run))]
    return [(str(row + 1), 1) for row in run]
