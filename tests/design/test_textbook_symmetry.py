"""Textbook optima that follow from symmetry: circles, cubes, simplices and balances.

A convex criterion that does not change under a group of the model has an optimum that does not
change either (Kiefer; Pukelsheim, Optimal Design of Experiments, chapter 13): the mean of a design
and its images is no worse. So few numbers remain to be found, by a formula or by a search over a
line. The cost and the bound of the relaxation must enclose each of them.
"""

from itertools import combinations, combinations_with_replacement, product
from math import comb

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax

GAP = 1e-6
ROUNDING = 1e-10
EVERY = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5")
# Large models are tried under the criteria that the literature has, the others take their time.
LARGE = ("A", "D", "E")


def rows(F):
    """One experiment a row."""
    return Problem(np.asarray(F)[:, None, :])


def check(problem, name, cost):
    """The relaxation's cost is this one to the gap, and its bound is not above it."""
    r = relax(problem, criteria.create(name))
    assert r.gap <= GAP
    assert r.cost == pytest.approx(cost, rel=GAP)
    assert r.cost >= cost * (1 - ROUNDING)
    assert r.proved_bound.cost <= cost * (1 + ROUNDING)
    again = r.certify(problem)
    assert again == pytest.approx((r.cost, r.proved_bound.cost), rel=ROUNDING)
    return r


def cost_of_spectrum(name, eigenvalues):
    """The cost of a diagonal information matrix, by the formulas of Table 1."""
    e = np.asarray(eigenvalues, dtype=float)
    product_of_roots = np.prod(e ** (-1 / len(e)))
    return {
        "A": np.sum(1 / e),
        "D": product_of_roots,
        "E": 1 / e.min(),
        "G": 1 / e.min(),
        "O1": np.sqrt(product_of_roots),
        "O2": np.sqrt(e.max() / e.min()),
        "O3": np.sqrt(1 / e.min()),
        "O4": np.sqrt(e.max()) / e.min(),
        "O5": np.sum(e**-0.5),
    }[name]


def test_spectra_in_print():
    """The formulas give what is printed: D = 2^(-(p-1)/p), A = 2p - 1, E = 1/2 on the circle."""
    for p in (3, 7, 17):
        spectrum = [1.0, *np.full(p - 1, 0.5)]
        assert cost_of_spectrum("D", spectrum) == pytest.approx(2 ** ((p - 1) / p))
        assert cost_of_spectrum("A", spectrum) == pytest.approx(2 * p - 1)
        assert cost_of_spectrum("E", spectrum) == pytest.approx(2)


@pytest.mark.parametrize(("p", "name"), [*product((3, 7), EVERY), *product((17,), LARGE)])
def test_trigonometric_regression(p, name):
    """1, cos t, sin t, .., cos mt, sin mt on the circle: M = diag(1, 1/2, .., 1/2) is best.

    Turns of the circle turn each pair (cos jt, sin jt). A design that turns do not change has the
    same information about both, and ``cos^2 + sin^2 = 1`` says which: 1/2 (Pukelsheim, 9.16). The
    largest variance of G is no less than the mean of a pair, which turns do not change.
    """
    m = p // 2
    t = 2 * np.pi * np.arange(4 * m + 3) / (4 * m + 3)
    harmonics = [wave(j * t) for j in range(1, m + 1) for wave in (np.cos, np.sin)]
    problem = rows(np.column_stack([np.ones(len(t)), *harmonics]))
    check(problem, name, cost_of_spectrum(name, [1.0, *np.full(p - 1, 0.5)]))


@pytest.mark.parametrize(("k", "name"), [*product((4, 6), EVERY), *product((8,), LARGE)])
def test_first_order_on_the_cube(k, name):
    """Factors at two levels, k of them: M = I, as no diagonal entry can be above one.

    The centre of the cube is a candidate too, and gets no weight.
    """
    corners = np.array(list(product((-1.0, 1.0), repeat=k)))
    points = np.vstack([np.zeros(k), corners])
    problem = rows(np.column_stack([np.ones(len(points)), points]))
    r = check(problem, name, cost_of_spectrum(name, np.ones(k + 1)))
    assert r.weights[0] <= np.sqrt(GAP)


def full_quadratic(x):
    """Rows of the full quadratic model of points (n, k)."""
    mixed = [x[:, i] * x[:, j] for i, j in combinations(range(x.shape[1]), 2)]
    return np.column_stack([np.ones(len(x)), x, x**2, *mixed])


def kiefer_moments(k):
    """The moments u = E x_i^2 and v = E x_i^2 x_j^2 of the D-optimum on the k-cube.

    Kiefer (Optimum experimental designs V, 1961); Farrell, Kiefer and Walbran (1967).
    """
    root = np.sqrt(4 * k**2 + 12 * k + 17)
    u = (k + 3) / (4 * (k + 1) * (k + 2) ** 2) * (2 * k**2 + 3 * k + 7 + (k - 1) * root)
    cubic = 4 * k**3 + 8 * k**2 + 11 * k - 5
    v = (k + 3) / (8 * (k + 2) ** 3 * (k + 1)) * (cubic + (2 * k**2 + k + 3) * root)
    return u, v


def log_det(k, u, v):
    """Compute log det M of the full quadratic with moments u and v, and E x_i^4 = u.

    The factors are k linear terms u, k(k-1)/2 products v, k - 1 contrasts of squares u - v, and
    constant and sum of squares together ``u + (k-1) v - k u^2``.
    """
    together = u + (k - 1) * v - k * u**2
    return k * np.log(u) + comb(k, 2) * np.log(v) + (k - 1) * np.log(u - v) + np.log(together)


@pytest.mark.parametrize("k", [2, 3, 4, 5])
def test_full_quadratic_d(k):
    """The full quadratic on 3^k: Kiefer's moments in closed form, of which det M is a function."""
    u, v = kiefer_moments(k)
    best = log_det(k, u, v)
    # The moments are a maximum: log det is concave, and both its derivatives are zero there.
    together = u + (k - 1) * v - k * u**2
    assert (1 - 2 * k * u) / together == pytest.approx(-k / u - (k - 1) / (u - v))
    assert (k - 1) / together == pytest.approx((k - 1) / (u - v) - comb(k, 2) / v)
    x = np.array(list(product((-1.0, 0.0, 1.0), repeat=k)))
    p = (k + 1) * (k + 2) // 2
    r = check(rows(full_quadratic(x)), "D", np.exp(-best / p))
    assert r.weights @ x[:, 0] ** 2 == pytest.approx(u, abs=np.sqrt(GAP))
    assert r.weights @ (x[:, 0] * x[:, 1]) ** 2 == pytest.approx(v, abs=np.sqrt(GAP))


@pytest.mark.parametrize("k", [2, 3, 4, 5])
def test_full_quadratic_a(k):
    """A on 3^k: the trace of the same blocks' inverses, at the best moments u and v.

    Constant and squares have the inverse's trace ``(k-1)/(u-v)`` for the contrasts, and
    ``(1 + e)/(e - k u^2)`` with ``e = u + (k-1) v`` for the two that are left.
    """

    def cost(moments):
        u, v = moments
        e = u + (k - 1) * v
        if not (u > v > 0 and e > k * u**2):
            return np.inf
        return k / u + comb(k, 2) / v + (k - 1) / (u - v) + (1 + e) / (e - k * u**2)

    options = {"xatol": 1e-10, "fatol": 1e-12}
    best = minimize(cost, kiefer_moments(k), method="Nelder-Mead", options=options).fun
    x = np.array(list(product((-1.0, 0.0, 1.0), repeat=k)))
    check(rows(full_quadratic(x)), "A", best)


@pytest.mark.parametrize("k", [2, 3, 4, pytest.param(5, marks=pytest.mark.slow)])
def test_full_quadratic_e(k):
    """E on 3^k: 1/5 for any k, as T_2(x_1) = 2 x_1^2 - 1 stays within +-1.

    With the coefficients c of T_2, ``lambda_min <= c'M c/c'c = E T_2^2/5 <= 1/5``.
    """
    x = np.array(list(product((-1.0, 0.0, 1.0), repeat=k)))
    check(rows(full_quadratic(x)), "E", 5.0)


def mixture(points, order):
    """Rows of Scheffe's model of an order for mixtures (n, q), without the higher powers."""
    q = points.shape[1]
    subsets = [s for size in range(1, order + 1) for s in combinations(range(q), size)]
    return np.column_stack([points[:, s].prod(axis=1) for s in subsets])


def lattice(q, levels):
    """All mixtures of q components whose shares are multiples of 1/levels."""
    chosen = combinations_with_replacement(range(q), levels)
    return np.array([np.bincount(c, minlength=q) for c in chosen]) / levels


def centroids(q, order):
    """Equal mixtures of up to `order` of q components."""
    subsets = [s for size in range(1, order + 1) for s in combinations(range(q), size)]
    return np.array([np.isin(range(q), s) / len(s) for s in subsets])


@pytest.mark.parametrize("name", ["D", "A", "E"])
@pytest.mark.parametrize("q", [2, 3, 4, 5, 6])
def test_first_order_mixtures(q, name):
    """Scheffe's linear model: equal weights on the q pure components, M = I/q."""
    check(rows(lattice(q, 4)), name, cost_of_spectrum(name, np.full(q, 1 / q)))


@pytest.mark.parametrize(("q", "order"), [(2, 2), (3, 2), (4, 2), (5, 2), (6, 2), (3, 3), (4, 3)])
def test_higher_order_mixtures_d(q, order):
    """Quadratic (Kiefer 1961) and special cubic (Uranisi 1964): equal weights on the centroids.

    The p rows X of the centroids of up to two (three) components form a triangular matrix, with
    ``1/4`` for each pair and ``1/27`` for each triple on its diagonal, and ``M = X'X/p``.
    """
    support = centroids(q, order)
    p = len(support)
    log_det_of_rows = -comb(q, 2) * np.log(4) - (order > 2) * comb(q, 3) * np.log(27)
    assert np.linalg.slogdet(mixture(support, order))[1] == pytest.approx(log_det_of_rows)
    grid = lattice(q, 12 if q < 4 else 4)
    apart = np.abs(grid[:, None] - support).max(axis=-1).min(axis=1) > 1e-9
    x = np.concatenate([support, grid[apart]])
    r = check(rows(mixture(x, order)), "D", p * np.exp(-2 * log_det_of_rows / p))
    np.testing.assert_allclose(r.weights[:p], 1 / p, atol=np.sqrt(GAP))


@pytest.mark.parametrize("q", [4, 5, 6])
def test_second_order_mixtures_a(q):
    """A for the quadratic, q >= 4: cost ``(q sqrt(4q-3) + 4 q(q-1)/2)^2`` (Galil and Kiefer 1977).

    On vertices and midpoints ``b_i = y_i`` and ``b_ij = 4 y_ij - 2 y_i - 2 y_j``: the columns of
    the inverse have the norms sqrt(1 + 4 (q-1)) and 4, and the best weights are in their ratio.
    """
    cost = (q * np.sqrt(4 * q - 3) + 4 * comb(q, 2)) ** 2
    x = np.unique(np.concatenate([lattice(q, 4), centroids(q, 3)]), axis=0)
    check(rows(mixture(x, 2)), "A", cost)


@pytest.mark.parametrize("name", ["A", "c"])
def test_one_interaction_of_a_mixture(name):
    """The coefficient b_12 alone: variance ``(2 + 2 + 4)^2`` = 64, half the weight at the midpoint.

    On the edge between the two components the model is a parabola, whose T_2 is extremal.
    """
    x = lattice(4, 4)
    problem = rows(mixture(x, 2))
    K = np.zeros(10)
    K[4] = 1
    criterion = criteria.create(name, **({"c": K} if name == "c" else {"interest": K}))
    r = relax(problem, criterion)
    assert r.gap <= GAP
    assert r.cost == pytest.approx(64, rel=GAP)
    assert r.weights[np.abs(x - [0.5, 0.5, 0, 0]).max(axis=1) < 1e-9].sum() == pytest.approx(0.5)


def weighings(k):
    """All choices of some of k objects, as rows of zeros and ones."""
    return np.array(list(product((0.0, 1.0), repeat=k)))[1:]


def balance_spectrum(k, share):
    """Eigenvalues of the mean over all subsets of j objects, in shares (k,) of j = 1 .. k.

    ``j^2/k`` belongs to the sum of all objects, ``j (k - j)/(k (k - 1))`` to each contrast.
    """
    j = np.arange(1, k + 1)
    return np.array([share @ j**2 / k, *np.full(k - 1, share @ (j * (k - j)) / (k * (k - 1)))])


@pytest.mark.parametrize("k", [3, 4, 5, 6, 7, 8])
def test_spring_balance_d(k):
    """D for weighing k objects on a spring balance, (k + 1)/2 at a time.

    For odd k ``det M = (k+1)^(k+1) / (4k)^k``. For even k the subsets of k/2 + 1 objects have the
    share ``k/(2k+2)`` beside those of k/2, where the eigenvalues are ``(k+2)/4`` and
    ``(k+2)/(4k+4)`` (Jacroux and Notz, Annals of Statistics 11, 1983).
    """
    if k % 2:
        log_det_of_best = (k + 1) * np.log(k + 1) - k * np.log(4 * k)
    else:
        log_det_of_best = k * np.log((k + 2) / 4) - (k - 1) * np.log(k + 1)
    check(rows(weighings(k)), "D", np.exp(-log_det_of_best / k))


@pytest.mark.parametrize("name", ["A", "E", "G", "O3", "O5"])
@pytest.mark.parametrize("k", [3, 4, 6, 7])
def test_spring_balance(k, name):
    """Of designs that treat all objects alike, two sizes of subsets are best; all are searched.

    The two eigenvalues are linear in the shares, so that the optimum lies on an edge of a polygon
    in the plane. The cost is convex along each edge.
    """

    def cost(share):
        spectrum = balance_spectrum(k, share)
        if name != "G":
            return cost_of_spectrum(name, spectrum)
        # A diagonal entry of the inverse of an invariant matrix: the mean of its eigenvalues.
        return np.mean(1 / spectrum)

    e = np.eye(k)
    best = min(
        minimize_scalar(
            lambda a, i=i, j=j: cost((1 - a) * e[i] + a * e[j]),
            bounds=(0, 1),
            method="bounded",
            options={"xatol": 1e-12},
        ).fun
        for i, j in combinations(range(k), 2)
    )
    # The search stops short of the ends of an edge.
    with np.errstate(divide="ignore"):
        best = min(best, *(cost(share) for share in e))
    check(rows(weighings(k)), name, best)


@pytest.mark.parametrize("k", [4, 8])
def test_chemical_balance(k):
    """On two pans each weighing tells all objects: M = I from {-1, 1}, whatever the criterion."""
    signs = np.array(list(product((-1.0, 1.0), repeat=k)))
    for name in ("D", "A", "E"):
        check(rows(signs), name, cost_of_spectrum(name, np.ones(k)))
