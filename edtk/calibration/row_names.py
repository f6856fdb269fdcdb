"""Rows of a file, as a person names them."""

from collections.abc import Sequence

SHOWN = 10  # rows that are named; of more, the number is said


def row_names(rows: Sequence[int]) -> str:
    """Some rows, counted from 1: "row 5", or "rows 5, 6 and 12 more"."""
    shown = ", ".join(str(row + 1) for row in rows[:SHOWN])
    more = f" and {len(rows) - SHOWN} more" if len(rows) > SHOWN else ""
    return f"row{'s' * (len(rows) > 1)} {shown}{more}"
