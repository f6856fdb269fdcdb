"""Some of very many rows, chosen by chance."""

import numpy as np

from edtk.findings.match_plan import some_rows


def test_few_rows_are_all_taken():
    """Rows that are not too many are all there, in their order."""
    np.testing.assert_array_equal(some_rows(5, 5), np.arange(5))


def test_many_rows_are_thinned():
    """Of many rows so many are chosen, each once, in order, and the same every time."""
    rows = some_rows(1000, 100)
    assert len(np.unique(rows)) == 100
    assert (np.diff(rows) > 0).all()
    np.testing.assert_array_equal(rows, some_rows(1000, 100))


def test_every_part_is_chosen_from():
    """Chosen rows are spread over all, whatever period poses have among them."""
    share = np.bincount(some_rows(10_000, 5000) % 4) / 5000
    np.testing.assert_allclose(share, 0.25, atol=0.03)
