"""Equal rows have equal numbers."""

import numpy as np
import pytest

from edtk.fit.correlated_noise import MANY_ROWS, row_numbers


@pytest.mark.parametrize("times", [1, MANY_ROWS])
def test_equal_rows_have_the_number_of_the_first_of_them(times):
    """Few rows and many are numbered in order of appearance; the sign of zero does not matter."""
    columns = np.array([[0.0, 1.0], [2.0, 1.0], [-0.0, 1.0], [np.nan, 1.0], [2.0, 1.0]])
    kinds = np.array([[0], [0], [0], [0], [1]])
    numbers = row_numbers(np.tile(columns, (times, 1)), np.tile(kinds, (times, 1)))
    assert numbers.tolist() == [0, 1, 0, 2, 3] * times


def test_no_rows():
    """Of no rows there are no numbers."""
    assert row_numbers(np.empty((0, 3))).shape == (0,)
