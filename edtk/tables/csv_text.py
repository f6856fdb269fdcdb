"""A table as the text of a CSV file."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def csv_text(table: "pd.DataFrame") -> str:
    """Write a table as CSV, with a header, without an index, and ten digits a number."""
    return str(table.to_csv(index=False, float_format="%.10g"))
