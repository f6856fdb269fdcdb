"""Plans of the same number of experiments as arrays."""

import numpy as np
from designs import KR270

from edtk.design.candidate_source import sample_feasible
from edtk.design.exact.search_record import Plans


def test_some_of_them():
    """Choosing keeps variables and repetitions together."""
    some = Plans(np.arange(12.0).reshape(3, 2, 2), np.arange(6.0).reshape(3, 2))[np.array([2, 0])]
    assert some.x[:, 0, 0].tolist() == [8, 0]
    assert some.repeats[:, 0].tolist() == [4, 0]


def test_replaced():
    """The better ones of another batch take their places, with their repetitions."""
    one = Plans(np.zeros((3, 2, 2)), np.ones((3, 2)))
    other = Plans(np.full((3, 2, 2), 5.0), np.full((3, 2), 7.0))
    mixed = one.replaced(np.array([False, True, False]), other)
    assert mixed.x[:, 0, 0].tolist() == [0, 5, 0]
    assert mixed.repeats[:, 1].tolist() == [1, 7, 1]


def test_information():
    """The information of each plan is that of its poses with their repetitions."""
    x = sample_feasible(KR270, 6, 0).reshape(2, 3, -1)
    repeats = np.array([[1.0, 2.0, 0.0], [1.0, 1.0, 3.0]])
    M = Plans(x, repeats).information(KR270)
    for own, poses, times in zip(M, x, repeats, strict=True):
        expected = KR270.problem(poses).information(times)
        np.testing.assert_allclose(own, expected, rtol=1e-11)
