"""Criteria of ill-conditioned parameters, computed in parameters where the model is not."""

import numpy as np
import pytest
from matrices import positive

import criteria
from criteria.linalg.inverse import whitener
from criteria.relaxable import TransformedByFactor
from edtk.certificate.recompute.values import cost, value

NAMES = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0", "rho_max")
PARAMETERS = {"phi": {"q": 0.4}, "c": {"c": [1.0, -2.0, 0.5, 3.0]}}
every = pytest.mark.parametrize("name", [*NAMES, *PARAMETERS, "phi0", "D of two", "prediction_G"])
EPS = np.finfo(float).eps


def make(name):
    """A criterion of four parameters."""
    rng = np.random.default_rng(7)
    if name == "phi0":
        return criteria.create("phi", q=0.0)
    if name == "D of two":
        return criteria.create("D", interest=np.eye(4)[:, :2])
    if name == "prediction_G":
        return criteria.create(name, points=rng.normal(size=(3, 4)))
    if name in PARAMETERS:
        return criteria.create(name, **PARAMETERS[name])
    return criteria.create(name, target=rng.normal(size=(3, 4)))


def skew(rng, spread):
    """A triangular T (4, 4) of condition about ten to the `spread`."""
    return np.triu(rng.normal(size=(4, 4)) + 3 * np.eye(4)) * 10.0 ** np.linspace(0, spread, 4)


@every
def test_same_cost_and_gradient(name):
    """The cost of T'M T is that of M, and the gradient follows it, for any regular T."""
    rng = np.random.default_rng(0)
    c = make(name)
    for _ in range(5):
        T = rng.normal(size=(4, 4)) + 2 * np.eye(4)
        M = positive(rng, 4)
        other = c.transformed(T)
        inside = T.T @ M @ T
        limit = 1e-12 * np.linalg.cond(inside) * np.linalg.cond(M)
        assert other.cost(inside) == pytest.approx(c.cost(M), rel=limit)
        S = np.linalg.inv(T)
        expected = S @ c.gradient(M) @ S.T
        np.testing.assert_allclose(
            other.gradient(inside), expected, atol=limit * np.abs(expected).max(), rtol=0
        )
        assert other.name == c.name
        assert other.degree == c.degree
        sharper = c.smoothed(30.0)
        found = other.smoothed(30.0).cost(inside)
        assert found == pytest.approx(sharper.cost(M), rel=limit)


@every
def test_same_bound(name):
    """A multiplier Z' of M' proves what ``T Z' T'`` proves of M."""
    rng = np.random.default_rng(1)
    c = make(name)
    for _ in range(5):
        T = rng.normal(size=(4, 4)) + 2 * np.eye(4)
        M = positive(rng, 4)
        Z = np.stack([positive(rng, 4), positive(rng, 4)])
        t = np.array([3.0, 5.0])
        found = c.transformed(T).lower_bound(Z, t, T.T @ M @ T)
        assert found == pytest.approx(c.lower_bound(T @ Z @ T.T, t, M), rel=1e-8)


@pytest.mark.parametrize("name", ["A", "D", "E", "G", "O1", "O3", "O5", "rho0", "phi", "phi0", "c"])
def test_tight_where_squares_have_no_digits_left(name):
    """At a condition of 1e9 minus the gradient at M' proves the cost of M', and no more.

    The same numbers of M itself, whose condition is 1e18, would be noise. The polar of G is found
    by a fixed-point iteration; the multipliers of phi have a condition of 1e7 themselves.
    """
    rng = np.random.default_rng(2)
    c = make(name)
    for _ in range(5):
        T = skew(rng, 9)
        M = positive(rng, 4)
        other = c.transformed(T)
        Z = -other.gradient(M)
        cost = float(other.cost(M))
        bound = other.lower_bound(Z[None], np.array([np.sum(Z * M)]), M)
        slack = {"G": 1e-6, "phi": 1e-8}.get(name, 1e-9)
        assert bound == pytest.approx(cost, rel=slack)
        assert bound <= cost * (1 + 1e-11)
        assert np.sum(Z * M) == pytest.approx(c.degree * cost, rel=1e-10)  # Euler


@pytest.mark.parametrize("name", ["A", "D", "E", "G", "O3", "O5", "rho0", "phi"])
def test_exact_at_diagonal_transforms(name):
    """Costs of diagonal M in units over twenty decades are those of exact arithmetic."""
    d = np.array([1e-10, 1e-3, 1e2, 1e10])
    m = np.array([2.0, 3.0, 5.0, 7.0])
    v = d**2 / m
    expected = {
        "A": v.sum(),
        "D": np.exp(np.log(v).mean()),
        "E": v.max(),
        "G": v.max(),
        "O3": np.sqrt(v.max()),
        "O5": np.sqrt(v).sum(),
        "rho0": np.sqrt((np.square(make("rho0").target) @ v).sum()) if name == "rho0" else 0,
        "phi": np.mean(v**0.4) ** 2.5,
    }[name]
    found = make(name).transformed(np.diag(d)).cost(np.diag(m))
    assert found == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("name", ["A", "D", "E", "G", "O1", "O3", "O5", "rho0", "D of two", "c"])
def test_multiplier_that_is_not_semidefinite_proves_nothing(name):
    """A negative eigenvalue makes the bound zero, whatever a determinant or a trace says."""
    rng = np.random.default_rng(3)
    c = make(name)
    M = positive(rng, 4)
    V = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    t = np.ones(1)
    for values in ([-1.0, -2.0, 3.0, 4.0], [-1e-6, 1.0, 2.0, 3.0], [-1, -1, -1, -1]):
        Z = V * np.array(values) @ V.T
        Z = 0.5 * (Z + Z.T)
        for criterion in (c, c.transformed(whitener(M))):
            assert criterion.lower_bound(Z[None], t, M) == 0.0


def test_without_a_relaxation_nothing_is_transformed():
    """A plug-in that cannot be relaxed, or that inverts in a way of its own, stays as it is."""

    class Plain(criteria.Criterion):
        name = "plain"
        degree = 1.0

        def _cost(self, M, cov):
            return np.trace(cov, axis1=-2, axis2=-1)

        def _gradient(self, M, cov):
            return -cov @ cov

    assert Plain().transformed(np.eye(2)) is None
    assert isinstance(criteria.create("phi", q=0.0).transformed(np.eye(2)), TransformedByFactor)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("least", [1e-2, 1e-4, 1e-6])
def test_cost_by_rows_is_that_of_singular_values(name, least):
    """A nearly singular plan costs what its rows say, not what their squares have kept of them."""
    rng = np.random.default_rng(3)
    c = make(name)
    U = np.linalg.qr(rng.normal(size=(4, 10, 4)))[0]
    V = np.linalg.qr(rng.normal(size=(4, 4, 4)))[0]
    B = U * np.geomspace(1.0, least, 4) @ V
    target = np.random.default_rng(7).normal(size=(3, 4))
    printed = [value(name, rows, [target]) for rows in B]
    costs = c.cost_by_rows(np.swapaxes(B, 1, 2) @ B, lambda i: B[i])
    np.testing.assert_allclose(costs, [cost(name, each) for each in printed], rtol=2e-9)


@pytest.mark.parametrize("rows", [[[2.0, 0.0]], [[2.0, 2.0, 2.0], [1.0, 2.0, 2.0]]])
def test_cost_by_rows_is_that_of_information_that_leaves_something_open(rows):
    """What is of interest is told; no transform makes the rows orthonormal."""
    B = np.array(rows)
    c = criteria.create("c", c=np.eye(B.shape[1])[0])
    M = B.T @ B
    assert np.isfinite(c.cost(M))
    assert c.cost_by_rows(M[None], lambda i: B)[0] == c.cost(M)
