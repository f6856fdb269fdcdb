"""Textbook optima of I, c, Ds, phi and prediction G: values, weights and valid bounds to 1e-6."""

import numpy as np
import pytest

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax

X = np.linspace(-1, 1, 41)
QUADRATIC = np.vander(X, 3, increasing=True)
# Moments of the uniform distribution on [-1, 1].
MOMENTS = np.array([[1, 0, 1 / 3], [0, 1 / 3, 0], [1 / 3, 0, 1 / 5]])


def check(F, criterion, cost, weights=None):
    """The relaxation over single rows has this cost, proves it, and has these weights."""
    problem = Problem(F[:, None, :])
    r = relax(problem, criterion)
    assert r.cost == pytest.approx(cost, rel=1e-6)
    assert cost * (1 - 1e-6) <= r.proved_bound.cost <= r.cost * (1 + 1e-9)
    _, bound = r.certify(problem)
    assert bound == pytest.approx(r.proved_bound.cost, rel=1e-9)
    if weights is not None:
        np.testing.assert_allclose(r.weights[r.weights > 1e-5], weights, atol=2e-4)
    return r


def test_i_of_a_quadratic_over_an_interval():
    """Over [-1, 1] the weights are 1/4, 1/2, 1/4, and the cost 32/15 (Atkinson and others)."""
    check(QUADRATIC, criteria.create("I", W=MOMENTS), 32 / 15, [0.25, 0.5, 0.25])


def test_i_of_a_line_beyond_its_data():
    """The mean variance of predictions at 0 and 2 from observations at -1 and 1.

    Predictions at x weigh the observations by (1 - x)/2 and (1 + x)/2, so that the cost is
    ``(a + b)^2`` for the root mean squares a and b of the two.
    """
    F = np.column_stack([np.ones(41), X])
    a = np.sqrt((0.25 + 0.25) / 2)
    b = np.sqrt((0.25 + 2.25) / 2)
    points = [[1.0, 0.0], [1.0, 2.0]]
    check(F, criteria.create("I", points=points), (a + b) ** 2, [a / (a + b), b / (a + b)])


@pytest.mark.parametrize("x", [1.0, 1.5, 3.0])
def test_c_of_an_extrapolation(x):
    """A quadratic extrapolated to x has the cost T_2(x)^2, by Hoel and Levine (1964)."""
    check(QUADRATIC, criteria.create("c", c=[1, x, x**2]), (2 * x**2 - 1) ** 2)


def test_c_of_one_point_is_singular():
    """Inside the interval the best experiment is to measure there: all weight on one point."""
    r = check(QUADRATIC, criteria.create("c", c=[1, 0, 0]), 1.0)
    assert np.linalg.matrix_rank(Problem(QUADRATIC[:, None]).information(r.weights)) == 1


def test_ds_of_the_highest_coefficient():
    """Of degree 2: weights 1/4, 1/2, 1/4 and a variance of 4, by Chebyshev's polynomial."""
    check(QUADRATIC, criteria.create("Ds", interest=[0, 0, 1.0]), 4.0, [0.25, 0.5, 0.25])


@pytest.mark.parametrize("q", [0.0, 0.4, 1.0, 2.0, 8.0])
def test_phi_of_spring_balances_and_designs_with_an_orthogonal_optimum(q):
    """On a 2^3 factorial every phi_q has the full factorial's information I, so cost one."""
    signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
    F = np.column_stack([np.ones(8), signs])
    check(F, criteria.create("phi", q=q), 1.0)


@pytest.mark.parametrize("q", [0.3, 2.0])
def test_phi_of_independent_parameters(q):
    """Single rows ``a_i e_i``: weights go as ``a_i^(-2q/(q+1))`` by Lagrange's condition."""
    a = np.array([1.0, 2.0, 5.0])
    w = a ** (-2 * q / (q + 1))
    w /= w.sum()
    cost = np.mean((w * a**2) ** -q) ** (1 / q)
    check(np.diag(a), criteria.create("phi", q=q), cost, w)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_prediction_g_has_the_optimum_of_d(degree):
    """Over the candidates themselves the largest variance is p (Kiefer and Wolfowitz)."""
    F = np.vander(X, degree + 1, increasing=True)
    check(F, criteria.create("prediction_G", points=F), degree + 1.0)
