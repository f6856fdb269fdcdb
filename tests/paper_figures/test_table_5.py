"""Table 5 beside print."""

import pandas as pd

from paper_figures import printed_values, table_5
from paper_figures.example import load_example


def test_printed_table_has_five_plans_and_five_parameters():
    """The typed table has the shape of the paper's."""
    printed = printed_values.table_5()
    assert list(printed.index) == [2, 3, 4, 6, 12]
    assert list(printed.columns) == ["k2", "k3", "k4", "k5", "k6"]


def test_every_cell_is_within_three_per_mille_of_print():
    """All 25 standard deviations agree with print within 0.3 %."""
    table = table_5.compute(load_example())
    assert len(table) == 25
    assert table["difference_percent"].abs().max() < 0.3


def test_files_hold_the_table(tmp_path):
    """The CSV holds every cell and the Markdown shows computed, printed and difference."""
    csv, text = table_5.write(load_example(), tmp_path)
    assert len(pd.read_csv(csv)) == 25
    shown = text.read_text(encoding="utf-8")
    assert all(shown.count(f"| {word}") == 5 for word in ("computed", "printed", "difference"))
