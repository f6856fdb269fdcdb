"""Markdown tables."""

from edtk.report.tables import markdown_table


def test_table():
    """Text is left-aligned and numbers right-aligned, in columns of one width."""
    text = markdown_table(["plan", "rho0", "m"], [["a", "1.25e-06", 2], ["longer", "-", 12]])
    assert text == (
        "| plan   |     rho0 |   m |\n"
        "|--------|---------:|----:|\n"
        "| a      | 1.25e-06 |   2 |\n"
        "| longer |        - |  12 |\n"
    )


def test_bars_are_escaped():
    """A bar inside a cell does not end it."""
    assert markdown_table(["x"], [["A | B"]]).splitlines()[2] == "| A \\| B |"


def test_no_rows():
    """A table without rows is its header."""
    assert len(markdown_table(["a", "b"], []).splitlines()) == 2


def test_all_lines_are_equally_wide():
    """Every line of a table has the same width, whatever is in its cells."""
    lines = markdown_table(["name", "a long header"], [["x", "12 %"], ["y" * 20, ""]]).splitlines()
    assert len({len(line) for line in lines}) == 1
