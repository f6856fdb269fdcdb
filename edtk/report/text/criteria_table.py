"""The table of all criteria."""

from collections.abc import Iterable, Mapping
from typing import Any


def criteria_table(rows: Iterable[Mapping[str, Any]]) -> str:
    """A line for each criterion.

    Args:
        rows: The answers of `Criterion.describe()`.
    """
    lines = [f"{'name':6}{'sense':6}{'convex':8}{'title':32}formula"]
    for row in rows:
        convex = "yes" if row["convex"] else "no"
        lines.append(f"{row['name']:6}{row['sense']:6}{convex:8}{row['title']:32}{row['formula']}")
    return "\n".join(lines)
