"""The rows of one kind of plan in a table of comparison."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def plans_of(
    table: "pd.DataFrame", kind: str, optimised_for: str = "", size: int | None = None
) -> "pd.DataFrame":
    """Choose plans.

    Args:
        table: The table of a study's run.
        kind: "optimised", "distinct", "published" or "random".
        optimised_for: Name of a criterion; "" for plans that were not optimised.
        size: Number of experiments; None for any.
    """
    chosen = (table["kind"] == kind) & (table["optimised_for"] == optimised_for)
    return table[chosen if size is None else chosen & (table["experiments"] == size)]
