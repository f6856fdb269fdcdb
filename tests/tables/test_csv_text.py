"""Tables as text."""

import io

import numpy as np
import pandas as pd
import pytest

from edtk.tables.csv_text import csv_text


@pytest.mark.parametrize("text", ["=1+1", "+x", "-x", "@SUM(A1)", " =1", "\t=1", '=A1,"x"'])
def test_no_cell_is_a_formula(text):
    """Text in a cell or in the header gets an apostrophe, without which it is what it was."""
    table = pd.DataFrame({text: [text, "plain"], "number": [-1.5, 2.0], "none": [None, text]})
    back = pd.read_csv(io.StringIO(csv_text(table)), skipinitialspace=False)
    assert list(back) == [f"'{text}", "number", "none"]
    assert back.iloc[:, 0].str.removeprefix("'").tolist() == [text, "plain"]
    assert back["number"].tolist() == [-1.5, 2.0]
    assert back["none"].isna().tolist() == [True, False]


def test_numbers_stay_numbers():
    """Negative numbers have no apostrophe, whatever the kind of their column."""
    table = pd.DataFrame(
        {"a": [-1.0, np.nan], "b": [-2, 3], "c": pd.Series([-1, "x"], dtype=object)}
    )
    assert csv_text(table) == "a,b,c\n-1,-2,-1\n,3,x\n"
