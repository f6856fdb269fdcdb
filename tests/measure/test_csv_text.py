"""Tables as text."""

import io

import numpy as np
import pandas as pd
import pytest

from edtk.measure.cells import csv_text


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


def test_many_rows_are_printed_as_few_are():
    """The fast way of many rows prints what pandas prints, whatever a column holds."""
    count = 1003
    rng = np.random.default_rng(0)
    table = pd.DataFrame(
        {
            "row": np.arange(count),
            "axis, named": np.tile(["x", "=y", "z"], count)[:count],
            "value": rng.normal(size=count) * 10.0 ** rng.integers(-20, 20, count),
        }
    )
    gaps = table.assign(value=np.where(table["row"] % 7, table["value"], np.nan))
    quoted = table.assign(name="a,b")
    for each in (table, gaps, quoted):
        parts = [csv_text(each[first : first + 100], 7) for first in range(0, count, 100)]
        whole = parts[0] + "".join(part.split("\n", 1)[1] for part in parts[1:])
        assert csv_text(each, 7) == whole
