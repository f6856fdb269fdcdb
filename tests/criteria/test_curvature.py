"""The second derivative of log cost in closed form, against differences of the gradient."""

import numpy as np
import pytest
from matrices import make, positive, symmetric

import criteria
from criteria.criterion import derivatives
from criteria.linalg.inverse import whitener
from criteria.linalg.typing import triangle

NAMES = (*(n for n in criteria.available() if n != "phi"), "phi 0", "phi 2")
CURVED = [n for n in NAMES if make(n, 3).curvature(np.eye(3)) is not None]
KINKED = [n for n in NAMES if not make(n, 3).smooth]
curved = pytest.mark.parametrize("name", CURVED)


def log_slope(criterion, M, H):
    """The derivative of log cost at M along H."""
    cost, G = criterion.cost_and_gradient(M)
    return np.vdot(G, H) / cost


def check(criterion, M, H, derivative):
    """The closed forms at M along H are the slope and its derivative."""
    root = whitener(M)
    found = criterion.curvature(root)
    p = len(M)
    np.testing.assert_allclose(found.V.T @ found.V, np.eye(p), atol=1e-12)
    assert (found.W >= 0).all()
    np.testing.assert_allclose(found.W, found.W.T, rtol=1e-12)
    assert found.z.sum() == pytest.approx(criterion.degree)
    T = root @ found.V
    E = T.T @ H @ T
    slope = log_slope(criterion, M, H)
    assert -found.z @ np.diag(E) == pytest.approx(slope, rel=1e-9, abs=1e-12)
    second = (found.W * E**2).sum() - found.c * slope**2
    by_differences = derivative(
        lambda t: log_slope(criterion, M + t[0] * H, H)[None], np.zeros(1), 1e-3
    )[0, 0]
    assert second == pytest.approx(by_differences, rel=1e-6, abs=1e-9)


@curved
@pytest.mark.parametrize("p", [1, 2, 5])
def test_curvature(name, p, derivative):
    """The second derivative of log cost along any direction is that of the closed form."""
    rng = np.random.default_rng(p)
    for _ in range(5):
        M = positive(rng, p)
        H = symmetric(rng, p)
        check(make(name, p), M, 0.1 * H, derivative)


@curved
def test_equal_eigenvalues(name, derivative):
    """Where eigenvalues are the same, the divided differences have their limits."""
    rng = np.random.default_rng(0)
    check(make(name, 4), np.diag([2.0, 2.0, 2.0 + 1e-9, 3.0]), 0.1 * symmetric(rng, 4), derivative)


@pytest.mark.parametrize("name", ["A", "D", "O1", "O5"])
@pytest.mark.parametrize("s", [1, 2, 4])
def test_combinations(name, s, derivative):
    """A criterion of combinations adds what the nuisance parameters do, for any combinations."""
    rng = np.random.default_rng(s)
    criterion = criteria.create(name, interest=rng.normal(size=(4, s)))
    check(criterion, positive(rng, 4), 0.1 * symmetric(rng, 4), derivative)


@pytest.mark.parametrize("name", ["A", "D", "O5", "rho0"])
def test_other_parameters(name, derivative):
    """As a function of other parameters a criterion has the curvature of the same function."""
    rng = np.random.default_rng(1)
    T = rng.normal(size=(4, 4))
    check(make(name, 4).transformed(T), positive(rng, 4), 0.1 * symmetric(rng, 4), derivative)


@pytest.mark.parametrize("q", [0, 0.5, 1, 2, 10])
def test_phi(q, derivative):
    """Kiefer's family has a curvature for each order."""
    rng = np.random.default_rng(2)
    criterion = criteria.create("phi", q=q)
    check(criterion, positive(rng, 4), 0.1 * symmetric(rng, 4), derivative)


@pytest.mark.parametrize("name", KINKED)
def test_kinks_have_none(name):
    """Where a cost has kinks, there is no second derivative to give."""
    assert make(name, 3).curvature(np.eye(3)) is None


@pytest.mark.parametrize("name", ["A", "D", "O5", "rho0"])
def test_squares(name):
    """As a sum of squares the second derivative is the same."""
    rng = np.random.default_rng(3)
    M = positive(rng, 4)
    found = make(name, 4).curvature(whitener(M))
    E = symmetric(rng, 4)
    rows, columns = triangle(4)
    P = found.squares(E[rows, columns, None])
    expected = (found.W * E**2).sum() - found.c * (found.z @ np.diag(E)) ** 2
    assert np.sum(P**2) == pytest.approx(expected, rel=1e-12)


def test_sum_of_terms(derivative):
    """Log cost of a compound is a sum, and so are its derivatives."""
    rng = np.random.default_rng(4)
    parts = ["D", {"name": "c", "c": [1.0, 2.0, 0.0]}, {"name": "phi", "q": 2}]
    criterion = criteria.create("compound", criteria=parts, weights=[1, 2, 3], best=[2, 3, 4])
    M = positive(rng, 3)
    H = 0.1 * symmetric(rng, 3)
    root = whitener(M)
    terms = criterion.curvatures(root)
    assert len(terms) == 3
    changes = [(root @ term.V).T @ H @ (root @ term.V) for term in terms]
    pairs = list(zip(terms, changes, strict=True))
    slope = -sum(term.z @ np.diag(E) for term, E in pairs)
    assert slope == pytest.approx(log_slope(criterion, M, H), rel=1e-9)
    rows, columns = triangle(3)
    second = sum(np.sum(term.squares(E[rows, columns, None]) ** 2) for term, E in pairs)
    by_differences = derivative(
        lambda t: log_slope(criterion, M + t[0] * H, H)[None], np.zeros(1), 1e-3
    )[0, 0]
    assert second == pytest.approx(by_differences, rel=1e-6)


@curved
def test_curvatures_of_several_roots_are_those_of_each(name):
    """The criteria of this package take several roots at once, and each has its own curvature."""
    criterion = make(name, 4)
    assert criterion.batched_curvature
    rng = np.random.default_rng(5)
    roots = np.array([whitener(positive(rng, 4)) for _ in range(3)])
    slopes, seconds = criterion.curvature(roots).by_entries(roots, *triangle(4))
    for R, slope, second in zip(roots, slopes, seconds, strict=True):
        own_slope, own_second = criterion.curvature(R).by_entries(R, *triangle(4))
        np.testing.assert_allclose(slope, own_slope, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(second, own_second, rtol=1e-9, atol=1e-12)


def test_a_curvature_that_takes_one_root_is_not_asked_for_several():
    """A criterion of somebody else, whose curvature knows one matrix, has its differences."""

    class Own(type(make("A", 3))):
        batched_curvature = False

        def curvature(self, R):
            assert R.ndim == 2
            return super().curvature(R)

    rng = np.random.default_rng(6)
    M = np.array([positive(rng, 3) for _ in range(3)])
    for own, exact in zip(derivatives(Own(), M), derivatives(make("A", 3), M), strict=True):
        np.testing.assert_allclose(own, exact, rtol=1e-4, atol=1e-4 * np.abs(exact).max())
