"""The table of all criteria."""

from collections.abc import Iterable, Mapping
from typing import Any

from edtk.report.text_table import name_width


def criteria_table(rows: Iterable[Mapping[str, Any]]) -> str:
    """A line for each criterion.

    Args:
        rows: The answers of `Criterion.describe()`.
    """
    described = list(rows)
    first = name_width((row["name"] for row in described), 6)
    title = name_width((row["title"] for row in described), 32)
    lines = [f"{'name':{first}}{'sense':6}{'convex':8}{'title':{title}}formula"]
    for row in described:
        convex = "yes" if row["convex"] else "no"
        name = f"{row['name']:{first}}{row['sense']:6}{convex:8}"
        lines.append(f"{name}{row['title']:{title}}{row['formula']}")
    return "\n".join(lines)
