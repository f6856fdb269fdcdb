"""One thing that looks wrong in a sheet of positions, or in what was fitted to it."""

from dataclasses import dataclass
from typing import Any

from edtk.findings.diagnostic import Severity

MOST_ROWS = 12  # that a sentence names


@dataclass(frozen=True)
class GeometricDoubt:
    """One thing that looks wrong.

    Attributes:
        severity: Its consequence for the result.
        kind: A word for programs.
        text: One line: what is wrong, where, and what was done or is expected.
        rows: Rows of the file, counted from 0.
    """

    severity: Severity
    kind: str
    text: str
    rows: tuple[int, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Severity, kind and text; rows are counted from 1."""
        return {
            "severity": self.severity.name.lower(),
            "kind": self.kind,
            "text": self.text,
            "rows": [row + 1 for row in self.rows],
        }


def rows_in_words(rows: "tuple[int, ...] | list[int]") -> str:
    """Rows of a file, counted from 1: "row 3", "rows 3, 5 to 9 and 12 more"."""
    runs: list[list[int]] = []
    for row in sorted(rows):
        if runs and row == runs[-1][-1] + 1:
            runs[-1].append(row)
        else:
            runs.append([row])
    shown = [part for run in runs for part in _run_in_words(run)]
    named = shown[:MOST_ROWS]
    more = len(rows) - sum(count for _, count in named)
    listed = ", ".join(words for words, _ in named) + (f" and {more} more" if more else "")
    return f"row{'s' if len(rows) > 1 else ''} {listed}"


def _run_in_words(run: list[int]) -> list[tuple[str, int]]:
    """Rows that follow each other, with how many rows each part of the words is of."""
    if len(run) > 2:
        return [(f"{run[0] + 1} to {run[-1] + 1}", len(run))]
    return [(str(row + 1), 1) for row in run]
