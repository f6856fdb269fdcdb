"""Polars: the least cost of all matrices that a multiplier allows, attained and homogeneous."""

import numpy as np
import pytest
from matrices import EPS, make, orthogonal, positive, slip, symmetric
from scipy.optimize import minimize

import criteria

pytestmark = pytest.mark.slow

POLARS = ("A", "D", "E", "G", "O1", "O3", "O5", "rho0", "rho_max")
GAP = 1e-6

of_degree = pytest.mark.parametrize("name", POLARS)
sizes = pytest.mark.parametrize("p", [1, 2, 3, 6])


def minimise_weights(f, p):
    """Least value of a convex function of weights (p,) of sum one, found over their roots theta."""
    found = minimize(lambda theta: f(theta**2 / (theta @ theta)), np.ones(p), tol=1e-12)
    return found.fun


def attaining(name, Z, target):
    """The matrix of ``<Z, X> = 1`` that the docstring of the polar names, up to its length."""
    z, V = np.linalg.eigh(Z)
    if name == "rho0":
        root = (V * z**0.5) @ V.T
        inverse = (V * z**-0.5) @ V.T
        s, U = np.linalg.eigh(root @ target.T @ target @ root)
        X = inverse @ (U * s**0.5) @ U.T @ inverse
    else:
        X = (
            V * z ** {"A": -0.5, "D": -1.0, "O1": -1.0, "E": 0.0, "O3": 0.0, "O5": -2 / 3}[name]
        ) @ V.T
    return X / np.sum(Z * X)


@sizes
@pytest.mark.parametrize("name", ["A", "D", "E", "O1", "O3", "O5", "rho0"])
def test_polar_is_attained(name, p):
    """The polar is the cost of the matrix that its docstring names.

    For rho0 it is that of a weighted A-criterion.
    """
    for seed in range(5):
        rng = np.random.default_rng(seed)
        Z = positive(rng, p, 1e3)
        target = rng.normal(size=(p + 1, p))
        c = make(name, p) if name != "rho0" else criteria.create(name, target=target)
        X = attaining(name, Z, target)
        expected = pytest.approx(c.cost(X), rel=slip(X, Z))
        assert c.polar(Z, positive(rng, p)) == expected
    if name in ("D", "O1"):
        np.testing.assert_allclose(
            X, np.linalg.inv(Z) / p, rtol=slip(Z), atol=slip(Z) * np.abs(X).max()
        )


@sizes
def test_polar_of_g_is_attained_where_variances_are_equal(p):
    """With equal variances and ``Z = cov U cov``, U any weights, M is the best of all.

    The polar says so.
    """
    for seed in range(5):
        rng = np.random.default_rng(seed)
        cov = positive(rng, p)
        cov /= np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
        M = np.linalg.inv(cov)
        c = make("G", p)
        for u in (rng.dirichlet(np.ones(p)), np.eye(p)[0]):
            Z = (cov * u) @ cov
            assert c.polar(Z, M) == pytest.approx(c.cost(M) * np.sum(Z * M), rel=slip(M, M @ M))


@pytest.mark.parametrize("p", [2, 3, 4])
def test_polar_of_g_is_near_the_best_over_all_weights(p):
    """The polar is at most the largest ``(trace (U^(1/2) Z U^(1/2))^(1/2))^2`` over weights u.

    That is the true polar, by minimax. It is no less than at the weights from which it starts.
    """
    rng = np.random.default_rng(p)
    c = make("G", p)
    for _ in range(5):
        Z = positive(rng, p, 1e2)
        M = positive(rng, p)

        def bound(u, Z=Z):
            K = np.sqrt(u)[:, None] * Z * np.sqrt(u)
            return np.sqrt(np.maximum(np.linalg.eigvalsh(K), 0)).sum() ** 2

        first = np.diag(M @ Z @ M)
        start = max(
            bound(first / first.sum()), bound(np.eye(p)[np.diag(np.linalg.inv(M)).argmax()])
        )
        best = -minimise_weights(lambda u, bound=bound: -bound(u), p)
        assert start * (1 - slip(Z)) <= c.polar(Z, M) <= best * (1 + GAP)


@sizes
@of_degree
def test_polar_is_below_every_matrix(name, p):
    """No X with <Z, X> = 1 costs less than the polar, near the best X either, at any M."""
    rng = np.random.default_rng(p)
    for _ in range(6):
        Z = positive(rng, p, 1e3)
        M = positive(rng, p, 1e2)
        c = make(name, p)
        X = [positive(rng, p, 1e4) for _ in range(100)] + [M, np.linalg.inv(Z)]
        if name not in ("G", "rho0", "rho_max"):
            best = attaining(name, Z, None)
            X += [
                best,
                *(best + 1e-3 * np.linalg.eigvalsh(best)[0] * symmetric(rng, p) for _ in range(20)),
            ]
        X = np.stack(X)
        X /= np.einsum("ij,nij->n", Z, X)[:, None, None]
        costs = c.cost(X)
        assert 0 < c.polar(Z, M) <= costs.min() * (1 + slip(X[costs.argmin()], Z))


@sizes
@of_degree
def test_polar_is_homogeneous(name, p):
    """polar(c Z) = c**degree * polar(Z) over sixteen decades of c, for M of any size."""
    rng = np.random.default_rng(p)
    c = make(name, p)
    for _ in range(5):
        Z = positive(rng, p, 1e3)
        M = positive(rng, p)
        for factor in (1e-8, 0.3, 1e8):
            expected = pytest.approx(factor**c.degree * c.polar(Z, M), rel=slip(Z, M))
            assert c.polar(factor * Z, M) == expected
            assert c.polar(factor * Z, M / factor) == expected


@pytest.mark.parametrize("p", [2, 4])
@of_degree
def test_polar_proves_nothing_of_an_open_direction(name, p):
    """A multiplier that is zero in a direction proves no more than the others cost.

    The information along that direction may grow without limit, and the cost of M then shrinks to
    the bound or beyond.
    """
    rng = np.random.default_rng(p)
    c = make(name, p)
    Q = orthogonal(rng, p)
    Z = Q[:, 1:] @ np.diag(rng.uniform(1, 2, size=p - 1)) @ Q[:, 1:].T
    M = positive(rng, p)
    M /= np.sum(Z * M)
    far = M + 1e8 * np.outer(Q[:, 0], Q[:, 0])
    assert np.sum(Z * far) == pytest.approx(1, abs=1e8 * 16 * p * EPS)
    assert c.polar(Z, M) <= c.cost(far) * (1 + 1e-6)
