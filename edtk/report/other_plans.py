"""The plans of a comparison that nobody has optimised here."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.report.plans_of import plans_of

if TYPE_CHECKING:
    import pandas as pd


def other_plans(table: "pd.DataFrame") -> dict[str, "pd.DataFrame"]:
    """Published and random plans, in groups of one plan a size, by the group's name in a report.

    Several published plans of one size are groups of their own, named after their files.

    Args:
        table: The table of a study's run.
    """
    published = plans_of(table, "published")
    labels = [_label(row["plan"], row["experiments"]) for _, row in published.iterrows()]
    groups = {
        label: published[np.array([other == label for other in labels], dtype=bool)]
        for label in dict.fromkeys(labels or ["published"])
    }
    return groups | {"random": plans_of(table, "random")}


def _label(plan: str, size: int) -> str:
    """The name of a published plan's group, from its name in the table, see `Case.name`."""
    file = plan.partition(f"_m{size}_")[2]
    return f"published ({file})" if file else "published"
