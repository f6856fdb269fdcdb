"""The tables of all criteria."""

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


def families_table(rows: Iterable[Mapping[str, Any]]) -> str:
    """A line for each criterion that needs parameters, with their names.

    Args:
        rows: The answers of `Criterion.describe()`, with the names as `parameters`.
    """
    described = [{**row, "parameters": ", ".join(row["parameters"])} for row in rows]
    first = name_width((row["name"] for row in described), 6)
    title = name_width((row["title"] for row in described), 32)
    formula = name_width((row["formula"] for row in described), 24)
    lines = [f"{'name':{first}}{'sense':6}{'title':{title}}{'formula':{formula}}parameters"]
    for row in described:
        name = f"{row['name']:{first}}{row['sense']:6}{row['title']:{title}}"
        lines.append(f"{name}{row['formula']:{formula}}{row['parameters']}")
    return "\n".join(["With parameters, see `criterion` of a study:", *lines])
