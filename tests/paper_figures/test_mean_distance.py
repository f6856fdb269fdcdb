"""The exact mean length of a normal vector."""

import numpy as np
import pytest
from scipy.integrate import quad

from paper_figures.mean_distance import mean_distance


@pytest.mark.parametrize(
    ("dimensions", "expected"),
    [(1, np.sqrt(2 / np.pi)), (2, np.sqrt(np.pi / 2)), (3, np.sqrt(8 / np.pi))],
)
def test_equal_variances_give_the_mean_of_the_chi_distribution(dimensions, expected):
    """The integral gives the half-normal, Rayleigh and Maxwell means, also in micrometres."""
    cov = np.zeros((3, 3))
    cov[range(dimensions), range(dimensions)] = 1e-12
    assert mean_distance(cov) == pytest.approx(1e-6 * expected, rel=1e-12)


def test_two_different_variances_give_an_elliptic_integral():
    """For diag(1, b) the mean is sqrt(2/pi) E(1-b), computed here as a mean over angles."""
    for b in (0.9, 0.3, 1e-3):
        arc = quad(lambda a, b=b: np.sqrt(np.cos(a) ** 2 + b * np.sin(a) ** 2), 0, np.pi / 2)[0]
        assert mean_distance(np.diag([1.0, b])) == pytest.approx(np.sqrt(2 / np.pi) * arc, rel=1e-6)


def test_turning_the_axes_changes_nothing_and_stacks_broadcast():
    """Only the eigenvalues matter, and a stack is evaluated matrix by matrix."""
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    cov = np.diag([3.0, 1.0, 0.2])
    stack = mean_distance(np.array([cov, turn @ cov @ turn.T, 4 * cov]))
    assert stack[1:] == pytest.approx([stack[0], 2 * stack[0]], rel=1e-12)
