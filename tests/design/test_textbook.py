"""Optimal designs of the literature and of theory: any linear or linearised model, given as blocks.

On the support of an optimum the relative loss of a design is at least the sum of the squared errors
of its weights, for D, A and E alike, so that a gap g leaves weights within sqrt(g).
"""

from itertools import combinations, product

import cvxpy as cp
import numpy as np
import pytest
from numpy.polynomial import Polynomial, chebyshev, legendre
from scipy.optimize import minimize, minimize_scalar

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax

GAP = 1e-6
EPS = np.finfo(float).eps
NAMES = criteria.available()
DEGREES = pytest.mark.parametrize("degree", range(1, 6))


def rows(F):
    """One experiment a row."""
    return Problem(np.asarray(F)[:, None, :])


def candidates(support, low=-1.0, high=1.0, n=41):
    """A grid that holds the support exactly; without it the grid costs more than the gap."""
    grid = np.linspace(low, high, n)
    apart = np.abs(grid[:, None] - support).min(axis=1) > 1e-6
    return np.sort(np.concatenate([grid[apart], support]))


def vander(x, degree):
    """Rows of polynomial regression, the lowest power first."""
    return np.vander(x, degree + 1, increasing=True)


def at(weights, x, support):
    """The weights of the support, in its order, after a check that they are nearly all."""
    found = np.array([weights[np.abs(x - s) < 1e-9].sum() for s in support])
    assert found.sum() == pytest.approx(1, abs=np.sqrt(GAP))
    return found


def check(name, x, F, support, weights, cost):
    """The relaxation over rows F of points x has the optimum (support, weights) and its cost."""
    r = relax(rows(F), criteria.create(name))
    assert r.gap <= GAP
    assert r.cost == pytest.approx(cost, rel=GAP)
    rounding = 64 * F.shape[1] * EPS * np.linalg.cond(rows(F).information(r.weights))
    assert r.proved_bound.cost <= cost * (1 + rounding)
    np.testing.assert_allclose(at(r.weights, x, support), weights, atol=np.sqrt(GAP))


def a_optimum(support, degree):
    """Weights w_i ~ b_i of the A-optimum on a saturated support, and its cost ``(sum b_i)^2``.

    With V the rows of the support, trace (V' W V)^-1 = sum b_i^2 / w_i for b_i the norm of column i
    of V^-1.
    """
    b = np.linalg.norm(np.linalg.inv(vander(support, degree)), axis=0)
    return b / b.sum(), b.sum() ** 2


@DEGREES
def test_polynomial_regression_d(degree):
    """D-optimum: equal weights on the roots of (1 - x^2) P_d'(x); det M by Vandermonde."""
    support = np.sort(
        np.concatenate([[-1, 1], legendre.Legendre.basis(degree).deriv().roots().real])
    )
    differences = [b - a for a, b in combinations(support, 2)]
    cost = (degree + 1) * np.prod(differences) ** (-2 / (degree + 1))
    x = candidates(support)
    check("D", x, vander(x, degree), support, np.full(degree + 1, 1 / (degree + 1)), cost)


@DEGREES
def test_polynomial_regression_a(degree):
    """A-optimum: d + 1 symmetric points with ends -1 and 1, the inner ones by a direct search."""

    def points(inner):
        middle = [0.0] if degree % 2 == 0 else []
        return np.sort(np.concatenate([[-1, 1], inner, -np.asarray(inner), middle]))

    inner = (degree - 1) // 2
    start = np.sort(np.cos(np.pi * np.arange(1, degree) / degree))[degree - 1 - inner :]
    if inner:
        options = {"xatol": 1e-9, "fatol": 1e-15}
        start = minimize(
            lambda v: np.log(a_optimum(points(v), degree)[1]),
            start,
            method="Nelder-Mead",
            options=options,
        ).x
    support = points(start)
    weights, cost = a_optimum(support, degree)
    x = candidates(support)
    check("A", x, vander(x, degree), support, weights, cost)


@DEGREES
def test_polynomial_regression_e(degree):
    """E-optimum: the extrema of Chebyshev's polynomial, lambda_min = 1/c'c of its coefficients c.

    From M c = lambda_min c, and values s = +-1 on the support, the weights are
    s_i (V^-T c)_i / c'c.
    """
    support = -np.cos(np.pi * np.arange(degree + 1) / degree)
    c = chebyshev.Chebyshev.basis(degree).convert(kind=Polynomial).coef
    weights = (
        (-1.0) ** (degree - np.arange(degree + 1))
        * np.linalg.solve(vander(support, degree).T, c)
        / (c @ c)
    )
    x = candidates(support)
    check("E", x, vander(x, degree), support, weights, c @ c)


@pytest.mark.parametrize(
    ("name", "degree", "weights", "value"),
    [
        ("D", 2, [1 / 3, 1 / 3, 1 / 3], (4 / 27) ** (1 / 3)),
        ("A", 2, [1 / 4, 1 / 2, 1 / 4], 8.0),
        ("E", 2, [1 / 5, 3 / 5, 1 / 5], 1 / 5),
        ("E", 4, None, 1 / 129),
        ("E", 5, None, 1 / 681),
    ],
)
def test_polynomial_regression_in_print(name, degree, weights, value):
    """The optima as they are printed: weights of degree two at -1, 0 and 1, least eigenvalues."""
    support = -np.cos(np.pi * np.arange(degree + 1) / degree)
    x = candidates(support)
    criterion = criteria.create(name)
    r = relax(rows(vander(x, degree)), criterion)
    printed = r.cost if criterion.sense == "min" else 1 / r.cost
    assert printed == pytest.approx(value, rel=GAP)
    if weights:
        np.testing.assert_allclose(at(r.weights, x, support), weights, atol=np.sqrt(GAP))


def full_quadratic(x):
    """Rows of the full quadratic model of points (n, q)."""
    q = x.shape[1]
    mixed = [x[:, i] * x[:, j] for i, j in combinations(range(q), 2)]
    return np.column_stack([np.ones(len(x)), x, x**2, *mixed])


@pytest.mark.parametrize(
    ("factors", "levels", "value"), [(2, 9, 0.474594), (3, 5, 0.474478)], ids=["square", "cube"]
)
def test_full_quadratic(factors, levels, value):
    """The full quadratic on square and cube: the printed det(M)^(1/p), the symmetric optimum."""
    x = np.array(list(product((-1.0, 0.0, 1.0), repeat=factors)))
    F = full_quadratic(x)
    orbit = np.abs(x).sum(axis=1).astype(int)
    size = np.bincount(orbit)

    def cost(z):
        share = np.exp(z - z.max()) / np.exp(z - z.max()).sum()
        M = F.T @ (F * (share / size)[orbit][:, None])
        return -np.linalg.slogdet(M).logabsdet / F.shape[1]

    best = np.exp(-minimize(cost, np.zeros(factors + 1), method="BFGS", options={"gtol": 1e-7}).fun)
    finer = np.array(list(product(np.linspace(-1, 1, levels), repeat=factors)))
    r = relax(rows(full_quadratic(finer)), criteria.create("D"))
    assert r.gap <= GAP
    assert 1 / r.cost == pytest.approx(best, rel=GAP)
    assert 1 / r.cost == pytest.approx(value, abs=0.5e-6 + GAP)  # six printed digits


def test_wynn_quadrilateral():
    """The linear model on the quadrilateral (2, 2), (-1, 1), (1, -1), (-1, -1): det M = 2.53125.

    The variance is a convex function of the point, so that the optimum lies on the corners. A
    determinant is the sum over triples of w_i w_j w_k times the squared double area of their
    triangle, which for weights u, v, v, s is ``64 u v^2 + 72 u v s + 16 v^2 s``. Equal derivatives
    (of v: doubled) give u = 1/2 - 2v/3, s = 1/2 - 4v/3 and 64 v = 18: the weights are 5/16, 9/32,
    9/32, 1/8, and det M = 81/32.
    """
    corners = np.array([[2, 2], [-1, 1], [1, -1], [-1, -1]])
    weights = np.array([10, 9, 9, 4]) / 32
    grid = np.array(
        [corner for corner in product(np.linspace(-1, 2, 31), repeat=2) if _inside(corner)]
    )
    x = np.concatenate(
        [corners, grid[[np.abs(corners - g).sum(axis=1).min() > 1e-9 for g in grid]]]
    )
    r = relax(rows(np.column_stack([np.ones(len(x)), x])), criteria.create("D"))
    assert r.gap <= GAP
    assert r.cost**-3 == pytest.approx(2.53125, rel=3 * GAP)
    np.testing.assert_allclose(r.weights[:4], weights, atol=np.sqrt(GAP))


def _inside(x):
    """Whether a point lies on the right side of the four edges of Wynn's quadrilateral."""
    a, b = x
    return a >= -1 and b >= -1 and 3 * b - a <= 4 + 1e-12 and 3 * a - b <= 4 + 1e-12


def test_box_lucas():
    """Box and Lucas: consecutive reactions, theta = (0.7, 0.2), are measured at t = 1.2295, 6.8577.

    The model is linearised at theta; t = 0, which tells nothing, is a candidate too. On two points
    of weights half each det M is the squared determinant of their rows over four.
    """

    def gradient(t):
        a = 0.7
        b = 0.2
        d = a - b
        u = np.exp(-b * t)
        v = np.exp(-a * t)
        return np.stack(
            [a * t * v / d - b * (u - v) / d**2, a * (u - v) / d**2 - a * t * u / d], axis=-1
        )

    def determinant(t):
        return abs(np.linalg.det(gradient(np.asarray(t))))

    options = {"xatol": 1e-9, "fatol": 1e-16}
    support = minimize(
        lambda t: -determinant(t), [1.0, 7.0], method="Nelder-Mead", options=options
    ).x
    np.testing.assert_allclose(support, [1.2295, 6.8577], atol=0.5e-4)
    h = 1e-6  # the derivatives are right: central differences err by h^2, and by eps/h in rounding

    def eta(theta, t):
        return theta[0] / (theta[0] - theta[1]) * (np.exp(-theta[1] * t) - np.exp(-theta[0] * t))

    theta = np.array([0.7, 0.2])
    for j, e in enumerate(h * np.eye(2)):
        slope = (eta(theta + e, support) - eta(theta - e, support)) / (2 * h)
        np.testing.assert_allclose(gradient(support)[:, j], slope, atol=1e-9)
    t = candidates(support, 0.0, 20.0, 201)
    check("D", t, gradient(t), support, [0.5, 0.5], 2 / determinant(support))


def random_blocks(seed, n=60, size=2, p=4):
    """Random regressors (n, size, p)."""
    return np.random.default_rng(seed).normal(size=(n, size, p))


@pytest.mark.parametrize(
    "problem",
    [
        rows(vander(np.linspace(-1, 1, 41), 3)),
        rows(full_quadratic(np.array(list(product((-1.0, 0.0, 1.0), repeat=2))))),
        Problem(random_blocks(0)),
        Problem(random_blocks(1, size=1) * [1e-7, 1e-3, 1, 1e4]),
    ],
    ids=["cubic", "square", "blocks of two", "badly scaled"],
)
def test_kiefer_wolfowitz(problem):
    """At a D-optimum no variance of a prediction, trace(cov M_i), is above p; their mean is p.

    A step of length a towards the candidate of largest variance d raises log det M by at least
    ``a (d - p) - a^2 d^2``, of which the best is ``((d - p) / 2 d)^2``; a gap g leaves
    ``-p log(1 - g)`` to gain.
    """
    r = relax(problem, criteria.create("D"))
    M = problem.information(r.weights)
    p = problem.p
    d = np.sqrt(np.diag(M))
    cov = np.linalg.inv(M / np.outer(d, d)) / np.outer(d, d)
    variance = np.einsum("ij,nji->n", cov, problem.blocks())
    rounding = 64 * p * EPS * np.linalg.cond(M / np.outer(d, d))
    assert r.gap <= GAP
    assert r.weights @ variance == pytest.approx(p, rel=rounding)
    largest = variance.max()
    assert largest >= p * (1 - rounding)
    assert ((largest - p) / (2 * largest)) ** 2 <= -p * np.log1p(-max(r.gap, rounding))
    # The mean of p - d_i is zero.
    assert (r.weights * (p - variance) <= largest - p + 2 * p * rounding).all()


INSTRUMENTS = {
    "even": np.ones(4),
    "uneven": np.array([0.3, 1.0, 2.5, 7.0]),
    "badly scaled": np.array([1e-7, 1e-2, 1e2, 1e4]) ** 2,
}


@pytest.mark.parametrize("a", INSTRUMENTS.values(), ids=INSTRUMENTS)
@pytest.mark.parametrize("name", NAMES)
def test_one_instrument_a_parameter(name, a):
    """Where instrument i measures k_i alone with information a_i, optima have a closed form.

    With M = diag(w_i a_i) and multipliers of Lagrange: A and rho0 (target diag c) have
    w_i ~ c_i a_i^(-1/2), D and O1 equal weights, O5 ``w_i ~ a_i^(-1/3)``; E, G, O2, O3 and O4 have
    equal eigenvalues, ``w_i ~ 1/a_i``. For O4: its cost is at least ``lambda_p^(-1/2)``, of which
    that is the least value. Each instrument has a twin of half the information. Badly scaled, O4
    needs weights of 1e-22 and O5 the cube roots of eigenvalues that are lost in rounding: of these
    two cost and bound enclose the optimum, and the gap may be larger.
    """
    # In the units of a, so that all parameters matter.
    c = np.array([0.5, 1.0, 2.0, 0.1]) * np.sqrt(a)
    least = np.sum(1 / a)
    cost = {
        "A": np.sum(a**-0.5) ** 2,
        "D": 4 / np.prod(a**0.25),
        "E": least,
        "G": least,
        "O1": np.sqrt(4 / np.prod(a**0.25)),
        "O2": 1.0,
        "O3": np.sqrt(least),
        "O4": np.sqrt(least),
        "O5": np.sum(a ** (-1 / 3)) ** 1.5,
        "rho0": np.sum(c * a**-0.5),
        "rho_max": np.sum(c * a**-0.5),  # of a single task
    }[name]
    problem = rows(np.concatenate([np.diag(np.sqrt(a)), np.diag(np.sqrt(a / 2))]))
    r = relax(problem, criteria.create(name, target=np.diag(c)))
    rounding = 64 * 4 * EPS  # the matrices are diagonal
    assert r.proved_bound.cost <= cost * (1 + rounding)
    assert r.cost >= cost * (1 - rounding)
    assert r.gap <= GAP or (name in ("O4", "O5") and a.max() > 1e20 * a.min())


def test_o2_of_a_straight_line():
    """O2 of the straight line on [a, b]: the ends, with equal information.

    A matrix of trace one is ``I/2`` plus a vector of the plane, and its condition number grows with
    the vector's length. The rows (1, x) are points on a circle of radius 1/2, at the angle
    2 arctan x; of the arc's hull the middle of the chord is the point nearest to the centre. Hence
    the cost is cot((arctan b - arctan a)/2).
    """
    for a, b in ((1, 3), (0.5, 2), (0.2, 6), (2, 30)):
        x = np.linspace(a, b, 41)
        r = relax(rows(vander(x, 1)), criteria.create("O2"))
        cost = 1 / np.tan((np.arctan(b) - np.arctan(a)) / 2)
        assert r.gap <= GAP
        assert r.cost == pytest.approx(cost, rel=GAP)
        information = r.weights * (1 + x**2) / (r.weights @ (1 + x**2))
        np.testing.assert_allclose(information[[0, -1]], 0.5, atol=np.sqrt(GAP))


@pytest.mark.parametrize("seed", range(3))
def test_o2_by_a_direct_semidefinite_program(seed):
    """O2 over all candidates at once, ``min kappa`` over ``I <= sum u_i M_i <= kappa I``.

    The candidates have a direction in common, so that the optimum is not 1.
    """
    blocks = random_blocks(seed, n=30, size=1, p=4) + np.array([2.0, 1.0, 0.5, 0.0])
    problem = Problem(blocks)
    u = cp.Variable(30, nonneg=True)
    kappa = cp.Variable()
    M = sum(u[i] * N for i, N in enumerate(problem.blocks()))
    program = cp.Problem(cp.Minimize(kappa), [M >> np.eye(4), kappa * np.eye(4) >> M])
    program.solve(solver="CLARABEL")
    r = relax(problem, criteria.create("O2"))
    assert r.gap <= GAP
    assert r.cost > 1.1
    assert r.cost == pytest.approx(np.sqrt(kappa.value), rel=GAP)


@pytest.mark.slow
def test_o2_by_bisection():
    """O2 by bisection: kappa can be reached if ``kappa lambda_p - lambda_1 >= 0`` for a design."""
    x = np.linspace(-1, 1, 41)
    problem = rows(vander(x, 3))
    N = problem.with_unit_trace().blocks()
    w = cp.Variable(41, nonneg=True)
    t = cp.Variable(2)
    kappa = cp.Parameter(nonneg=True)
    M = sum(w[i] * block for i, block in enumerate(N))
    tight = [M >> t[0] * np.eye(4), t[1] * np.eye(4) >> M, cp.sum(w) == 1]
    program = cp.Problem(cp.Maximize(kappa * t[0] - t[1]), tight)
    low = 1.0
    high = 1e4
    while high - low > 1e-8 * low:
        kappa.value = np.sqrt(low * high)
        program.solve(solver="CLARABEL")
        if program.value >= 0:
            high = kappa.value
        else:
            low = kappa.value
    r = relax(problem, criteria.create("O2"))
    assert r.cost == pytest.approx(np.sqrt(high), rel=GAP)


def o4_of_moments(m, m2):
    """``sqrt(lambda_1)/lambda_2`` of [[1, m], [m, m2]], with det/lambda_1; inf if singular."""
    half = (1 + m2) / 2
    det = m2 - m**2
    largest = half + np.sqrt(np.maximum(half**2 - det, 0.0))
    return np.divide(largest**1.5, det, out=np.full(np.shape(det), np.inf), where=det > 0)


@pytest.mark.parametrize(("a", "b"), [(1, 3), (0.5, 2), (0.1, 1), (0.2, 6), (2, 30)])
def test_o4_of_a_straight_line_by_brute_force(a, b):
    """O4 of the straight line on [a, b]: no pair of moments beats the bound, the best has r.cost.

    The information is [[1, m], [m, m2]] with m in [a, b] and m2 between m^2 and the chord
    m (a + b) - a b: all of it is scanned, and the scan is refined about its best point. Both E- and
    O2-optimum are worse than the O4-optimum.
    """
    problem = rows(vander(np.linspace(a, b, 41), 1))
    r = relax(problem, criteria.create("O4"))
    low = np.array([a, 0.0])
    high = np.array([b, 1.0])
    costs = []
    for _ in range(25):
        m, share = np.meshgrid(np.linspace(low[0], high[0], 201), np.linspace(low[1], high[1], 201))
        cost = o4_of_moments(m, m**2 + share * (m - a) * (b - m))
        costs.append(cost.min())
        i = np.unravel_index(cost.argmin(), cost.shape)
        best = np.array([m[i], share[i]])
        width = (high - low) / 4
        low = np.maximum(best - width, [a, 0.0])
        high = np.minimum(best + width, [b, 1.0])
    assert r.gap <= GAP
    assert r.proved_bound.cost <= min(costs) * (1 + 64 * EPS * r.cost**2)
    assert r.cost == pytest.approx(min(costs), rel=GAP)
    for other in ("E", "O2"):
        rival = relax(problem, criteria.create(other))
        cost = float(r.criterion.cost(problem.information(rival.weights)))
        assert cost > r.cost * (1 + 1e3 * GAP)


@pytest.mark.slow
def test_o4_by_the_family_of_condition_numbers():
    """O4 as a one-dimensional family: no ``lambda_min`` at bounded condition beats the bound.

    With kappa = lambda_1/lambda_p the cost is ``sqrt(kappa/lambda_p)``. For each kappa of a fine
    scan one semidefinite program gives the largest lambda_p of designs no worse conditioned than
    kappa, hence the least cost of all designs of that kappa. The least kappa is the square of O2.
    """
    problem = Problem(random_blocks(3, n=25, size=1, p=3) + np.array([2.0, 1.0, 0.0]))
    r = relax(problem, criteria.create("O4"))
    least = relax(problem, criteria.create("O2")).cost ** 2
    w = cp.Variable(25, nonneg=True)
    t = cp.Variable()
    kappa = cp.Parameter(nonneg=True)
    M = sum(w[i] * N for i, N in enumerate(problem.blocks()))
    program = cp.Problem(
        cp.Maximize(t), [M >> t * np.eye(3), kappa * t * np.eye(3) >> M, cp.sum(w) == 1]
    )

    def cost(k):
        kappa.value = k
        program.solve(solver="CLARABEL")
        return np.sqrt(k / t.value)

    eigenvalues = np.linalg.eigvalsh(problem.information(r.weights))
    mine = eigenvalues[-1] / eigenvalues[0]
    scan = [cost(k) for k in np.geomspace(1.001 * least, 3 * mine, 30)]
    local = minimize_scalar(cost, bracket=(0.97 * mine, mine, 1.03 * mine), tol=1e-6).fun
    assert r.gap <= GAP
    assert r.proved_bound.cost <= min([*scan, local]) * (1 + 1e-7)  # what a default solver leaves
    assert r.cost == pytest.approx(min([*scan, local]), rel=2 * GAP)


@pytest.mark.parametrize("seed", range(3))
def test_o5_by_a_general_minimiser(seed):
    """O5 by a quasi-Newton method on the weights of all candidates, ``w = z^2 / z'z``.

    At a converged minimiser of a convex function the cost is right to the square of its gradient.
    """
    problem = Problem(random_blocks(seed, n=12, size=2, p=3))
    N = problem.blocks()

    def cost_and_gradient(z):
        total = z @ z
        w = z**2 / total
        m, V = np.linalg.eigh(np.tensordot(w, N, axes=1))
        slope = np.einsum("ij,nji->n", -0.5 * (V * m**-1.5) @ V.T, N)
        return np.sum(m**-0.5), 2 * z / total * (slope - slope @ w)

    found = minimize(
        cost_and_gradient,
        np.full(12, 1.0),
        jac=True,
        method="BFGS",
        options={"gtol": 1e-7, "maxiter": 5000},
    )
    r = relax(problem, criteria.create("O5"))
    assert r.gap <= GAP
    assert r.cost == pytest.approx(found.fun, rel=GAP)
    rounding = 64 * 3 * EPS * np.linalg.cond(problem.information(r.weights))
    assert r.proved_bound.cost <= found.fun * (1 + rounding)


@pytest.mark.parametrize(
    "target", [[0, 1, 0, 0], [1, 2, 4, 8], [1, 0, 0, 0], [0, 0, 0, 1]], ids=str
)
def test_single_quantity_of_the_cubic(target):
    """One quantity c'k of the cubic: slope at 0, value at 2 and 0, leading coefficient.

    By Elfving, the deviation is the largest |c'k| over polynomials that stay within +-1 on [-1, 1].
    Chebyshev's T is extremal for the slope at 0 (3), the value at 2 (26) and the leading
    coefficient (4), the constant for the value at 0 (1); the last of these optima is singular, and
    only approached.
    """
    support = np.array([-1, -0.5, 0.5, 1])
    x = candidates(support)
    r = relax(rows(vander(x, 3)), criteria.create("rho0", target=np.array([target], dtype=float)))
    expected = {(0, 1, 0, 0): 3, (1, 2, 4, 8): 26, (1, 0, 0, 0): 1, (0, 0, 0, 1): 4}[tuple(target)]
    assert r.gap <= GAP
    assert r.cost == pytest.approx(expected, rel=GAP)
    assert r.proved_bound.cost <= expected * (1 + 1e-12)
