"""Tables for notebooks and terminals."""

from edtk.report.tables import SHOWN, notebook_table, text_table


def test_everything_is_escaped() -> None:
    """No text can end its cell."""
    text = notebook_table("<a>", ["<b>"], [["<c>"]], ["<d>"])
    assert all(f"&lt;{letter}&gt;" in text for letter in "abcd")


def test_long_tables_are_cut() -> None:
    """Of very many rows the first are shown, and the number of the others is said."""
    text = notebook_table("many", ["row"], [[f"row {i}"] for i in range(SHOWN + 5)])
    assert f"<td>row {SHOWN - 1}</td>" in text
    assert f"<td>row {SHOWN}</td>" not in text
    assert "and 5 more rows" in text


def test_columns_of_text_are_aligned() -> None:
    """The first column is aligned to the left, the others to the right."""
    assert text_table(["name", "m"], [["a", 2], ["longer", 100]]) == (
        "name      m\na         2\nlonger  100"
    )
