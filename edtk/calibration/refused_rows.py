"""Rows of a table that have no answer, while the others have one."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from edtk.system.errors import UserError

MOST_NAMED = 3  # rows that a sentence names one by one


@dataclass(frozen=True)
class RefusedRow:
    """A row that is left out, and why.

    Attributes:
        row: The row, counted from 0.
        reason: What is wrong with it.
        column: The column at fault; empty if none is.
    """

    row: int
    reason: str
    column: str = ""

    @property
    def place(self) -> str:
        """Row, counted from 1, and column."""
        return f"row {self.row + 1}" + (f", column {self.column}" if self.column else "")

    @property
    def text(self) -> str:
        """One line."""
        return f"{self.place}: {self.reason}"

    def to_dict(self) -> dict[str, Any]:
        """For JSON; rows are counted from 1 there."""
        return {"row": self.row + 1, "column": self.column or None, "reason": self.reason}


class RefusedRowsError(Exception):
    """Some rows of a batch have no answer.

    Args:
        rows: Those rows, in their order.
    """

    def __init__(self, rows: Sequence[RefusedRow]) -> None:
        super().__init__(rows[0].text)
        self.rows = tuple(rows)


def require_one(answered: int, refused: Sequence[RefusedRow], where: Path | str) -> None:
    """Check that a row at least has an answer.

    Raises:
        UserError: None has; says why of the first one.
    """
    if answered or not refused:
        return
    first = min(refused, key=lambda row: row.row)
    raise UserError(first.reason, where=where, key=first.place)


def refused_in_words(refused: Sequence[RefusedRow]) -> str:
    """How many rows are left out, and why the first of them are; empty for none."""
    if not refused:
        return ""
    named = "; ".join(row.text for row in refused[:MOST_NAMED])
    more = len(refused) - MOST_NAMED
    also = f"; and {more} more" if more > 0 else ""
    return f"{len(refused)} row{'s' * (len(refused) > 1)} left out: {named}{also}"
