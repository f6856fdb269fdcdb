"""Probabilities that a person reads."""

import pytest

from edtk.findings.finding import shown_probability


@pytest.mark.parametrize(
    ("p", "text"), [(0.01461, "= 0.015"), (1.0, "= 1"), (0.0, "< 1e-300"), (3e-200, "= 3e-200")]
)
def test_a_probability_is_never_shown_as_zero(p, text):
    """Below what a double holds it is shown as less than that."""
    assert shown_probability(p) == text
