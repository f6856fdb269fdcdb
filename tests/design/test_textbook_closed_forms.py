"""Optima of ordinary models in closed form, each with the equation that it comes from."""

from itertools import combinations, permutations, product

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.special import roots_jacobi

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax

GAP = 1e-6


def check(rows, name, cost, **parameters):
    """The relaxation over single rows has this cost, and proves it with a valid bound."""
    found = relax(Problem(rows[:, None, :]), criteria.create(name, **parameters))
    assert found.cost == pytest.approx(cost, rel=GAP)
    assert found.proved_bound.cost <= cost * (1 + 1e-9)
    assert -1e-9 <= found.gap <= GAP


def saturated(F):
    """D's cost ``det(M)^(-1/p)`` of equal weights on p points with rows F (p, p)."""
    p = len(F)
    return np.exp(-2 * np.linalg.slogdet(F).logabsdet / p) * p


def beside(grid, *points):
    """A grid with further points among it."""
    return np.unique(np.concatenate([grid, *points]))


TRIGONOMETRIC = {
    "D": lambda p: 2.0 ** ((p - 1) / p),
    "A": lambda p: 2.0 * p - 1,
    "E": lambda p: 2.0,
    "G": lambda p: 2.0,
    "O2": lambda p: np.sqrt(2.0),
    "O4": lambda p: 2.0,
}


@pytest.mark.parametrize("p", [9, 21])
@pytest.mark.parametrize("name", [*TRIGONOMETRIC, "phi"])
def test_trigonometric_regression(name, p):
    """Equally spaced angles have ``M = diag(1, 1/2, .., 1/2)``, best for each criterion.

    Criteria here do not change with the origin of the angle, so that an optimum does not either
    (Pukelsheim, Optimal Design of Experiments, 9.16).
    """
    x = 2 * np.pi * np.arange(60) / 60
    harmonics = [f(k * x) for k in range(1, (p + 1) // 2) for f in (np.cos, np.sin)]
    rows = np.column_stack([np.ones(60), *harmonics])
    if name == "phi":
        check(rows, name, ((1 + (p - 1) * 2.0**3) / p) ** (1 / 3), q=3.0)
    else:
        check(rows, name, TRIGONOMETRIC[name](p))


def logistic(eta, a, b):
    """Rows of ``P = 1/(1 + exp(-a - b x))`` at the logits eta."""
    weight = 1 / (2 + np.exp(eta) + np.exp(-eta))
    return np.sqrt(weight)[:, None] * np.column_stack([np.ones_like(eta), (eta - a) / b])


@pytest.mark.parametrize(("a", "b"), [(1.0, 2.0), (-3.0, 0.5)])
def test_logistic_model(a, b):
    """D, the slope and the median dose, for parameters of several sizes.

    Two logits +-h are best for D with ``h tanh(h/2) = 1`` and for the slope with
    ``h tanh(h/2) = 2``; the median dose is best told at the logit 0, with variance 4.
    """
    of_d, of_slope = (brentq(lambda h, c=c: h * np.tanh(h / 2) - c, 0.1, 9) for c in (1.0, 2.0))
    grid = beside(np.linspace(-5, 5, 101), [-of_d, of_d, -of_slope, of_slope])
    rows = logistic(grid, a, b)
    check(rows, "D", saturated(logistic(np.array([-of_d, of_d]), a, b)))
    ends = logistic(np.array([-of_slope, of_slope]), a, b)
    check(rows, "c", 2 * np.linalg.inv(ends.T @ ends)[1, 1], c=[0.0, 1.0])
    check(rows, "c", 4.0, c=[1.0, -a / b])


@pytest.mark.slow
def test_emax_model():
    """D is best at 0, at ``e X/(X + 2 e)`` and at X; there the largest variance is p = 3."""
    for size, e, top in ((1.0, 25.0, 150.0), (0.7, 0.3, 1.0)):
        points = np.array([0.0, e * top / (top + 2 * e), top])
        x = beside(np.linspace(0, top, 101), points)
        F, best = (
            np.column_stack([np.ones_like(v), v / (e + v), -size * v / (e + v) ** 2])
            for v in (x, points)
        )
        check(F, "D", saturated(best))
        check(F, "prediction_G", 3.0, points=F)


def test_michaelis_menten_model():
    """D is best at ``K X/(2 K + X)`` and at X."""
    for V, K, top in ((3.0, 0.2, 2.0), (2.0, 4.0, 1.0)):
        points = np.array([K * top / (2 * K + top), top])
        x = beside(np.linspace(0.01 * top, top, 100), points)
        F, best = (np.column_stack([v / (K + v), -V * v / (K + v) ** 2]) for v in (x, points))
        check(F, "D", saturated(best))


@pytest.mark.parametrize("rate", [0.7, 3.0])
def test_exponential_decay(rate):
    """``y = a exp(-b t)`` is measured at 0 and at 1/b for D."""
    points = np.array([0.0, 1 / rate])
    t = beside(np.linspace(0, 10 / rate, 101), points)
    F, best = (
        np.column_stack([np.exp(-rate * v), -2 * v * np.exp(-rate * v)]) for v in (t, points)
    )
    check(F, "D", saturated(best))


@pytest.mark.parametrize("q", [3, 4])
def test_cubic_mixtures(q):
    """Scheffé's full cubic for D: vertices, edges at (1 +- 5^-1/2)/2, middles of faces."""
    inner = (1 - 5**-0.5) / 2
    support = [*np.eye(q)]
    for i, j in permutations(range(q), 2):
        support.append(inner * np.eye(q)[i] + (1 - inner) * np.eye(q)[j])
    support += [np.eye(q)[list(three)].mean(axis=0) for three in combinations(range(q), 3)]
    lattice = np.array([v for v in product(range(5), repeat=q) if sum(v) == 4]) / 4
    check(cubic(np.vstack([lattice, support])), "D", saturated(cubic(np.array(support))))


def cubic(X):
    """Rows of Scheffé's full cubic model of mixtures X (n, q)."""
    pairs = list(combinations(range(X.shape[1]), 2))
    products = [X[:, i] * X[:, j] for i, j in pairs]
    differences = [X[:, i] * X[:, j] * (X[:, i] - X[:, j]) for i, j in pairs]
    threes = [X[:, list(three)].prod(axis=1) for three in combinations(range(X.shape[1]), 3)]
    return np.column_stack([X, *products, *differences, *threes])


# Costs of the eigenvalues u (p - 1 times) and v of M.
SPRING = {
    "D": lambda p, u, v: (u ** (p - 1) * v) ** (-1 / p),
    "A": lambda p, u, v: (p - 1) / u + 1 / v,
    "E": lambda p, u, v: max(1 / u, 1 / v),
    "O2": lambda p, u, v: np.sqrt(max(u, v) / min(u, v)),
    "O4": lambda p, u, v: np.sqrt(max(u, v)) / min(u, v),
}


@pytest.mark.parametrize("p", [5, 6])
@pytest.mark.parametrize("name", SPRING)
def test_spring_balance(name, p):
    """Objects on a spring balance, p of them: all sets of j, for one j or a mixture of two.

    By symmetry M has the eigenvalues ``j (p - j)/(p (p - 1))`` and ``j^2/p``, means over j.
    """
    rows = np.array(list(product([0.0, 1.0], repeat=p)))
    levels = [(j * (p - j) / (p * (p - 1)), j * j / p) for j in range(1, p + 1)]

    def mixture(share, one, other):
        u, v = share * np.array(one) + (1 - share) * np.array(other)
        return SPRING[name](p, u, v) if u > 0 else 1e9

    least = min(SPRING[name](p, u, v) for u, v in levels if u > 0)
    for one, other in combinations(levels, 2):
        tried = minimize_scalar(
            mixture, bounds=(0, 1), args=(one, other), method="bounded", options={"xatol": 1e-12}
        )
        least = min(least, tried.fun)
    check(rows, name, least)


@pytest.mark.parametrize("degree", [6, 8])
def test_chebyshev_points(degree):
    """E, the last coefficient and an extrapolation share the extrema of Chebyshev's polynomial T.

    With its coefficients t the least eigenvalue is ``1/t't`` (Pukelsheim and Studden 1993), the
    last one has the variance ``t_d^2`` (Studden), and the value at z has ``T(z)^2``.
    """
    x = beside(np.linspace(-1, 1, 101), np.cos(np.pi * np.arange(degree + 1) / degree))
    rows = np.vander(x, degree + 1, increasing=True)
    last = np.eye(degree + 1)[degree]
    t = np.polynomial.chebyshev.cheb2poly(last)
    check(rows, "E", t @ t)
    check(rows, "Ds", t[-1] ** 2, interest=last[:, None])
    z = 1.5 ** np.arange(degree + 1)
    check(rows, "c", (t @ z) ** 2, c=z)


@pytest.mark.parametrize(("a", "b"), [(0.0, 0.0), (1.0, 0.5), (0.3, 2.0)])
@pytest.mark.parametrize("p", [3, 5])
def test_polynomials_with_jacobi_weights(a, b, p):
    """D with the efficiency ``(1 - x)^(a+1) (1 + x)^(b+1)``: the roots of Jacobi's polynomial."""
    roots = roots_jacobi(p, a, b)[0]
    x = beside(np.linspace(-1, 1, 101), roots)
    F, best = (
        np.sqrt((1 - v) ** (a + 1) * (1 + v) ** (b + 1))[:, None] * np.vander(v, p)
        for v in (x, roots)
    )
    check(F, "D", saturated(best))
