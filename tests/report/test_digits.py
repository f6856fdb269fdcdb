"""Digits that mean something."""

import pytest

from edtk.report.shown import digits


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (4.00051e-7, 5.7e-9, "4.001e-07"),
        (4.0005123e-7, 5.7e-12, "4.000512e-07"),
        (1.0, 0.9, "1.00e+00"),
        (-2.5e-6, 3e-8, "-2.500e-06"),
        (0.0, 3e-8, "0.00e+00"),
        (1.0, 0.0, "1.00e+00"),
        (1.0, float("inf"), "1.00e+00"),
        (1.0, 1e-30, "1.000000000000000e+00"),
    ],
)
def test_digits(value, std, text):
    """Down to the second digit of the standard deviation, with three digits at least."""
    assert digits(value, std) == text


def test_ends_of_an_interval_have_the_same_digits():
    """Of the same decade a value has as many as the one that it is compared with."""
    assert digits(6.56e-7, 7.1e-8, 9.361e-7) == "6.560e-07"
    assert digits(9.361e-7, 7.1e-8, 9.361e-7) == "9.361e-07"
    assert digits(6.56e-8, 7.1e-8, 9.361e-7) == "6.56e-08"
    assert digits(0.0, 7.1e-8, 9.361e-7) == "0.00e+00"
