"""Pure error against lack of fit."""

import numpy as np
import pytest

from edtk.fit.outliers import lack_of_fit

GROUP = np.repeat(np.arange(12), 3)


def residuals(rng, common):
    """Residuals of a fit of five parameters to 12 poses, three times each."""
    X = np.repeat(rng.standard_normal((12, 3, 5)), 3, axis=0)
    z = rng.standard_normal((36, 3)) + common * rng.standard_normal((12, 3))[GROUP]
    Q = np.linalg.qr(X.reshape(-1, 5))[0].reshape(36, 3, 5)
    return z - Q @ np.einsum("mrp,mr->p", Q, z)


def test_textbook_example():
    """Neter, Kutner: the split of a sum of squares by hand, for a line through repeated points."""
    x = np.array([1.0, 1, 2, 2, 3, 3])
    y = np.array([1.0, 3, 2, 4, 9, 7])
    slope, at_zero = np.polyfit(x, y, 1)
    z = (y - slope * x - at_zero)[:, None]
    found = lack_of_fit(z, np.array([0, 0, 1, 1, 2, 2]), 2)
    # Pure error: 2 + 2 + 2 = 6 with 3 degrees of freedom. Means 2, 3, 8 are off the line
    # y = 3 x - 5/3 by 2/3, -4/3, 2/3: twice the squares are 16/3, with 1 degree of freedom.
    assert pytest.approx(16 / 3 / 2) == found.F
    assert found.dof == (1, 3)
    assert found.pure_error == pytest.approx(np.sqrt(2))
    assert found.common == pytest.approx(np.sqrt((16 / 3 - 2) / 2))


@pytest.mark.slow
def test_level_and_power():
    """Good data are doubted at 1 % in about 1 % of cases; noise common to a pose is found."""
    rng = np.random.default_rng(0)
    good = [lack_of_fit(residuals(rng, 0.0), GROUP, 5).p for _ in range(1000)]
    # Binomial: 1 % of 1000 is 10 with a standard deviation of 3.
    assert 1 <= np.sum(np.array(good) < 0.01) <= 22
    common = [lack_of_fit(residuals(rng, 1.0), GROUP, 5) for _ in range(200)]
    assert np.mean([found.p < 0.01 for found in common]) > 0.95
    # The mean square of the means is s^2 + 3 t^2 over 31/36 of the groups' freedom: unbiased.
    assert np.mean([found.common**2 for found in common]) == pytest.approx(1.0, rel=0.1)


def test_nothing_to_compare():
    """Without repetitions, or with as many parameters as means, no test is made."""
    z = np.ones((4, 3))
    assert lack_of_fit(z, np.arange(4), 5) is None
    assert lack_of_fit(z, np.zeros(4, dtype=int), 3) is None
    assert lack_of_fit(np.zeros((4, 3)), np.array([0, 0, 1, 1]), 2) is None
