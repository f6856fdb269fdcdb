"""A table as the text of a CSV file."""

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

# A spreadsheet runs a cell that begins with one of these; blanks before them do not help.
FORMULA = re.compile(r"\s*[=+\-@]|[\t\r]")
TEXT_MARK = "'"  # before a cell that a spreadsheet shall take as text, as OWASP recommends


def csv_text(table: "pd.DataFrame") -> str:
    """Write a table as CSV, with a header, without an index, and ten digits a number.

    Text that a spreadsheet would run as a formula begins with an apostrophe; numbers stay numbers.
    """
    safe = table.set_axis([_as_text(name) for name in table.columns], axis="columns")
    for i, kind in enumerate(table.dtypes):
        if kind.kind not in "iufb":
            safe.isetitem(i, [_as_text(cell) for cell in table.iloc[:, i]])
    return str(safe.to_csv(index=False, float_format="%.10g"))


def _as_text(cell: Any) -> Any:
    """A cell that no spreadsheet runs; anything but text stays as it is."""
    return TEXT_MARK + cell if isinstance(cell, str) and FORMULA.match(cell) else cell
