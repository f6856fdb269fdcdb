"""How the search for a plan went."""

import pytest

from edtk.report.views.plan import search_summary


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ((128, 25.2, 1, 4), "128 starts in 25.2 s ended in 4 different plans, once in this one"),
        ((8, 0.04, 2, 2), "8 starts in 0.0 s ended in 2 different plans, twice in this one"),
        ((1, 1.0, 1, 1), "1 start in 1.0 s ended in one plan, once: this one"),
    ],
)
def test_numbers_of_starts_and_plans_read_as_a_sentence(given, text):
    """One start, and one plan, are not several."""
    assert search_summary(*given) == text
