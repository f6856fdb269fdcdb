"""Textbook optima of models over regions, whose points no grid holds: found, and enclosed.

Cost and bound must enclose the optimum to 1e-6, the cost from above and the bound from below.
"""

import numpy as np
import pytest
from numpy.polynomial import Polynomial, chebyshev, legendre
from scipy.optimize import brentq, minimize, minimize_scalar

import criteria
from edtk.design.bound import BoundKind
from edtk.design.region import Region
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relax_region import relax_region

GAP = 1e-6
ROUNDING = 1e-9
EPS = np.finfo(float).eps


def check(region, criterion, cost, points=None, weights=None):
    """The relaxation over a region has this cost, encloses it, and rests on these points."""
    if isinstance(criterion, str):
        criterion = criteria.create(criterion)
    r = relax_region(region, criterion)
    # Near a singular optimum rounding blurs the cost.
    rounding = max(ROUNDING, EPS * np.linalg.cond(r.information))
    assert r.kind is BoundKind.SEARCHED
    assert r.gap <= GAP
    assert r.cost == pytest.approx(cost, rel=GAP)
    assert r.cost >= cost * (1 - rounding)
    assert r.searched_bound.cost <= cost * (1 + ROUNDING)
    if points is not None:
        scale = np.ptp(region.limits)
        expected = np.asarray(points, dtype=float).reshape(len(points), -1)
        np.testing.assert_allclose(r.points, expected, atol=np.sqrt(GAP) * scale)
    if weights is not None:
        np.testing.assert_allclose(r.weights, weights, atol=np.sqrt(GAP))
    return r


def two_points(rows, bracket, fixed):
    """The A-cost of the best two points, one of which is fixed, by a search over the other.

    With V the rows of both points, ``trace (V' W V)^-1 = sum b_i^2/w_i`` for b_i the norm of column
    i of V^-1, and the best weights make it ``(sum b_i)^2``.
    """

    def cost(x):
        V = rows(np.array([[x], [fixed]]))
        return np.linalg.norm(np.linalg.inv(V), axis=0).sum() ** 2

    return minimize_scalar(cost, bounds=bracket, method="bounded", options={"xatol": 1e-10})


class MichaelisMenten:
    """y = V s/(K + s) on [0, b]: a parabola without a constant, in u = s/(K + s) on [0, B]."""

    def __init__(self, V, K, b):
        self.V = V
        self.K = K
        self.b = b
        self.B = b / (K + b)
        self.region = Region(self.rows, 0, b, parameters=("V", "K"))

    def rows(self, x):
        """Derivatives by V and K."""
        s = x[:, 0]
        return np.stack([s / (self.K + s), -self.V * s / (self.K + s) ** 2], axis=-1)

    def s(self, u):
        """The concentration at which s/(K + s) is u."""
        return self.K * u / (1 - u)


ENZYMES = pytest.mark.parametrize(
    "model",
    [MichaelisMenten(2, 1, 4), MichaelisMenten(212.7, 0.0641, 1.1), MichaelisMenten(1, 5, 3)],
    ids=["plain", "puromycin", "far from saturation"],
)


@ENZYMES
def test_michaelis_menten_d(model):
    """D: half at b and half at K b/(2K + b), where u is B/2 (Dunn 1988): det of rows V B^3/(4K)."""
    det = (model.V / model.K * model.B**3 / 4) ** 2 / 4
    low = model.K * model.b / (2 * model.K + model.b)
    check(model.region, "D", det**-0.5, [low, model.b], [0.5, 0.5])


@pytest.mark.slow
@ENZYMES
@pytest.mark.parametrize("name", ["A", "D"])
def test_michaelis_menten_single_parameters(model, name):
    """V alone, K alone: by Elfving, the parabola ``u (u - a)``, a = 2 (sqrt 2 - 1) B, is extremal.

    On [0, B] it stays within +-a^2/4 and takes these values at a/2 and B. K is the coefficient of
    ``u^2`` times -K/V; V is the value at u = 1, where no s is.
    """
    a = 2 * (np.sqrt(2) - 1) * model.B
    of_k = (model.K / model.V * 4 / a**2) ** 2
    of_v = ((1 - a) * 4 / a**2) ** 2
    points = [model.s(a / 2), model.b]
    for_k = criteria.create(name, interest=[0, 1.0])
    for_v = criteria.create(name, interest=[1.0, 0])
    check(model.region, for_k, of_k, points, [np.sqrt(0.5), 1 - np.sqrt(0.5)])
    check(model.region, for_v, of_v, points)


@ENZYMES
def test_michaelis_menten_a(model):
    """A: b and a point below it, found by a search over that point."""
    best = two_points(model.rows, (1e-3 * model.b, 0.9 * model.b), model.b)
    check(model.region, "A", best.fun, [best.x, model.b])


class Logistic:
    """P(y = 1) = 1/(1 + exp(-z)), z = alpha + beta x: rows ``sqrt(P (1 - P)) (1, x)``."""

    def __init__(self, alpha, beta, low, high):
        self.alpha = alpha
        self.beta = beta
        self.region = Region(self.rows, low, high, parameters=("alpha", "beta"))

    def rows(self, x):
        """The information of a binary answer is P (1 - P) = 1/(2 cosh z/2)^2."""
        z = self.alpha + self.beta * x[:, 0]
        return np.stack([np.ones_like(z), x[:, 0]], axis=-1) / (2 * np.cosh(z / 2))[:, None]

    def x(self, z):
        """The dose of a logit."""
        return (np.asarray(z) - self.alpha) / self.beta


ANSWERS = pytest.mark.parametrize(
    "model", [Logistic(0, 1, -10, 10), Logistic(1.3, 2, -4, 3)], ids=["canonical", "scaled"]
)


@ANSWERS
def test_logistic_d(model):
    """D: z = +-1.5434, the root of z tanh(z/2) = 1, half each (Abdelbasit and Plackett 1983)."""
    z = brentq(lambda z: z * np.tanh(z / 2) - 1, 1, 2, xtol=1e-14)
    assert z == pytest.approx(1.5434, abs=5e-5)
    weight = 1 / (2 * np.cosh(z / 2)) ** 2
    det = (weight * z / model.beta) ** 2
    check(model.region, "D", det**-0.5, model.x([-z, z]), [0.5, 0.5])


@ANSWERS
def test_logistic_slope(model):
    """The slope alone: z = +-2.3994, the root of z tanh(z/2) = 2, half each for alpha = 0."""
    z = brentq(lambda z: z * np.tanh(z / 2) - 2, 2, 3, xtol=1e-14)
    assert z == pytest.approx(2.3994, abs=5e-5)
    variance = (model.beta * 2 * np.cosh(z / 2) / z) ** 2
    criterion = criteria.create("D", interest=[0, 1.0])
    check(model.region, criterion, variance, model.x([-z, z]), [0.5, 0.5])


@ANSWERS
def test_logistic_median_dose(model):
    """The dose of one half, -alpha/beta: all answers there; M is singular, the variance 4/beta^2.

    ``d(-alpha/beta) = -(1, x_0)/beta`` is a multiple of the row at x_0, which is the longest in its
    direction, as the weight P (1 - P) is at most 1/4.
    """
    x = float(model.x(0))
    criterion = criteria.create("A", interest=-np.array([1, x]) / model.beta)
    r = check(model.region, criterion, 4 / model.beta**2)
    # M is singular at the optimum, so that a little weight may lie anywhere. With v the direction
    # of the row at x_0, C >= (c'v)^2/(v'M v), and v'M v is a mean of 1 - tanh(z/2)^2: a cost within
    # the gap leaves no more weight to where z is not zero.
    z = model.beta * (r.points[:, 0] - x)
    assert r.weights @ np.tanh(z / 2) ** 2 <= GAP


@pytest.mark.slow
def test_logistic_a_and_e():
    """Canonical A and E are symmetric: ``(1 + z^2)/(w z^2)`` at its least, and z = 1."""
    region = Logistic(0, 1, -10, 10).region

    def cost(z):
        return (1 + z**2) / z**2 * (2 * np.cosh(z / 2)) ** 2

    best = minimize_scalar(cost, bounds=(0.5, 3), method="bounded", options={"xatol": 1e-10})
    check(region, "A", best.fun, [-best.x, best.x], [0.5, 0.5])
    check(region, "E", (2 * np.cosh(0.5)) ** 2, [-1, 1], [0.5, 0.5])


def test_box_lucas():
    """Box and Lucas, theta = (0.7, 0.2): t = 1.2295 and 6.8577, half each, on [0, 20]."""
    a = 0.7
    b = 0.2
    d = a - b

    def rows(x):
        t = x[:, 0]
        u = np.exp(-b * t)
        v = np.exp(-a * t)
        by_a = a * t * v / d - b * (u - v) / d**2
        return np.stack([by_a, a * (u - v) / d**2 - a * t * u / d], axis=-1)

    def negative(t):
        return -abs(np.linalg.det(rows(t[:, None])))

    options = {"xatol": 1e-10, "fatol": 1e-17}
    best = minimize(negative, [1.0, 7.0], method="Nelder-Mead", options=options)
    np.testing.assert_allclose(best.x, [1.2295, 6.8577], atol=5e-5)
    check(Region(rows, 0, 20), "D", -2 / best.fun, best.x, [0.5, 0.5])


def test_exponential_decay():
    """Y = c exp(-r t): t = 0 and 1/r, half each; det of the rows is c/(r e)."""
    c = 3.0
    r = 0.4

    def rows(x):
        t = x[:, 0]
        return np.stack([np.exp(-r * t), -c * t * np.exp(-r * t)], axis=-1)

    check(Region(rows, 0, 30), "D", 2 * r * np.e / c, [0, 1 / r], [0.5, 0.5])


def test_poisson_counts():
    """Counts of mean exp(a + b x), b > 0: the top and 2/b below it, half each (Ford, 1992)."""
    a = -1.0
    b = 0.5
    top = 3.0

    def rows(x):
        root = np.exp((a + b * x[:, 0]) / 2)
        return np.stack([root, root * x[:, 0]], axis=-1)

    det = np.exp(2 * a + 2 * b * top - 2) * (2 / b) ** 2 / 4
    check(Region(rows, -20, top), "D", det**-0.5, [top - 2 / b, top], [0.5, 0.5])


def test_emax_dose_response():
    """E0 + Emax x/(D + x) on [0, b]: 0, D b/(b + 2 D), b, a third each: a parabola in x/(D + x)."""
    E = 7 / 15
    D = 25.0
    b = 150.0
    B = b / (D + b)

    def rows(x):
        u = x[:, 0] / (D + x[:, 0])
        return np.stack([np.ones_like(u), u, -E / D * u * (1 - u)], axis=-1)

    det = (E / D * B**3 / 4) ** 2 / 27
    points = [0, D * b / (b + 2 * D), b]
    check(Region(rows, 0, b), "D", det ** (-1 / 3), points, np.full(3, 1 / 3))


@pytest.mark.slow
@pytest.mark.parametrize("degree", [3, 7])
def test_polynomials(degree):
    """D rests on the roots of (1 - x^2) P'(x), E on the extrema of Chebyshev's polynomial."""

    def rows(x):
        return np.vander(x[:, 0], degree + 1, increasing=True)

    region = Region(rows, -1, 1)
    inner = legendre.Legendre.basis(degree).deriv().roots().real
    support = np.sort(np.concatenate([[-1, 1], inner]))
    log_det = 2 * np.linalg.slogdet(rows(support[:, None]))[1] / (degree + 1)
    weights = np.full(degree + 1, 1 / (degree + 1))
    check(region, "D", (degree + 1) * np.exp(-log_det), support, weights)
    c = chebyshev.Chebyshev.basis(degree).convert(kind=Polynomial).coef
    extrema = -np.cos(np.pi * np.arange(degree + 1) / degree)
    check(region, "E", c @ c, extrema)


@pytest.mark.slow
def test_broken_line():
    """1, x, (x - b)_+ on [-1, 1]: a third at both ends and at the break, where no slope is zero.

    The rows there have the determinant ``(1 + b)(1 - b)``, in whatever place b lies.
    """
    b = 0.1234567

    def rows(x):
        t = x[:, 0]
        return np.stack([np.ones_like(t), t, np.maximum(t - b, 0.0)], axis=-1)

    cost = 3 * (1 - b**2) ** (-2 / 3)
    check(Region(rows, -1, 1), "D", cost, [-1, b, 1], np.full(3, 1 / 3))


@pytest.mark.parametrize(("p", "name"), [(3, "D"), (7, "A"), (17, "D")])
def test_trigonometric_regression_on_the_circle(p, name):
    """On [0, 2 pi] M = diag(1, 1/2, .., 1/2) is best, whatever points give it."""

    def rows(x):
        waves = [wave(j * x[:, 0]) for j in range(1, p // 2 + 1) for wave in (np.cos, np.sin)]
        return np.column_stack([np.ones(len(x)), *waves])

    cost = {"D": 2 ** ((p - 1) / p), "A": 2 * p - 1, "E": 2.0}[name]
    check(Region(rows, 0, 2 * np.pi), name, cost)


def disc(x):
    """Not negative inside the unit circle."""
    return 1 - (x**2).sum(axis=1)


@pytest.mark.slow
def test_plane_on_the_disc():
    """First order on the disc: M = diag(1, 1/2, 1/2)."""

    def rows(x):
        return np.column_stack([np.ones(len(x)), x])

    region = Region(rows, [-1, -1], [1, 1], constraints=disc)
    for name, cost in (("D", 2 ** (2 / 3)), ("A", 5.0)):
        check(region, name, cost)


@pytest.mark.slow
def test_quadratic_on_the_disc():
    """Kiefer (1960): 1/6 in the centre, the rest evenly on the circle.

    With s = 5/6 the moments are E u^2 = s/2, E u^4 = 3s/8 and E u^2 v^2 = s/8, so that
    ``det M = (s/2)^2 (s/8) (s/4) (s/2 - s^2/2)``.
    """

    def rows(x):
        u, v = x.T
        return np.stack([np.ones_like(u), u, v, u**2, u * v, v**2], axis=-1)

    s = 5 / 6
    det = (s / 2) ** 2 * (s / 8) * (s / 4) * (s / 2 - s**2 / 2)
    region = Region(rows, [-1, -1], [1, 1], constraints=disc)
    r = check(region, "D", det ** (-1 / 6))
    centre = np.linalg.norm(r.points, axis=1) < 1e-3
    assert r.weights[centre].sum() == pytest.approx(1 / 6, abs=np.sqrt(GAP))


@pytest.mark.parametrize("q", [3, 4, 6])
def test_quadratic_mixtures(q):
    """Scheffe's quadratic of q components, q - 1 of them free: vertices and midpoints of edges."""

    def rows(x):
        share = np.column_stack([x, 1 - x.sum(axis=1)])
        i, j = np.triu_indices(q, 1)
        return np.column_stack([share, share[:, i] * share[:, j]])

    p = q * (q + 1) // 2
    region = Region(rows, np.zeros(q - 1), np.ones(q - 1), constraints=lambda x: 1 - x.sum(axis=1))
    r = check(region, "D", p * 16 ** (q * (q - 1) / 2 / p))
    assert len(r.points) == p


@pytest.mark.slow
def test_competitive_inhibition():
    """V s/(K (1 + i/L) + s): for the inhibition constant L alone two points are best.

    M is singular there, and many multipliers fit the design; a dense grid finds nothing better.
    """
    V, K, L = 1.0, 2.0, 0.5

    def rows(x):
        s, i = x.T
        d = K * (1 + i / L) + s
        return np.stack([s / d, -V * s * (1 + i / L) / d**2, V * s * K * i / L**2 / d**2], axis=-1)

    region = Region(rows, [0, 0], [20, 5], parameters=("V", "K", "L"))
    r = relax_region(region, criteria.create("A", interest=[0, 0, 1.0]))
    dense = np.stack(np.meshgrid(np.linspace(0, 20, 81), np.linspace(0, 5, 81)), axis=-1)
    on_grid = relax(region.problem(dense.reshape(-1, 2)), r.criterion)
    assert r.gap <= GAP
    assert len(r.points) == 2
    assert r.searched_bound.cost <= on_grid.cost * (1 + ROUNDING)
    assert r.cost <= on_grid.cost * (1 + ROUNDING)


def test_wynn_quadrilateral():
    """The plane on the quadrilateral (2, 2), (-1, 1), (1, -1), (-1, -1): det M = 81/32."""

    def rows(x):
        return np.column_stack([np.ones(len(x)), x])

    def edges(x):
        return np.stack([4 - 3 * x[:, 1] + x[:, 0], 4 - 3 * x[:, 0] + x[:, 1]], axis=-1)

    region = Region(rows, [-1, -1], [2, 2], constraints=edges)
    corners = [[-1, -1], [-1, 1], [1, -1], [2, 2]]
    check(region, "D", (32 / 81) ** (1 / 3), corners, np.array([4, 9, 9, 10]) / 32)


def test_counts_that_fall_with_two_doses():
    """Counts of mean exp(a - b x - c y): no dose, and each alone at 2/b or 2/c (Wang, 2006)."""
    a, b, c = 1.0, 2.0, 1.0

    def rows(x):
        root = np.exp((a - b * x[:, 0] - c * x[:, 1]) / 2)
        return np.stack([root, root * x[:, 0], root * x[:, 1]], axis=-1)

    points = np.array([[0, 0], [0, 2 / c], [2 / b, 0]])
    det = np.linalg.det(rows(points)) ** 2 / 27
    check(Region(rows, [0, 0], [5, 5]), "D", det ** (-1 / 3), points, np.full(3, 1 / 3))


def test_readings_that_lose_their_worth_towards_the_ends():
    """Weights x (1 - x) of a parabola: the nodes of Gauss and Legendre (Fedorov 1972, 2.3)."""

    def rows(x):
        x = x[:, 0]
        root = np.sqrt(x * (1 - x))
        return np.stack([root, root * x, root * x**2], axis=-1)

    nodes = 0.5 + 0.5 * legendre.legroots([0, 0, 0, 1]).real
    det = np.linalg.det(rows(nodes[:, None])) ** 2 / 27
    check(Region(rows, 0, 1), "D", det ** (-1 / 3), nodes, np.full(3, 1 / 3))


@pytest.mark.slow
def test_a_forecast_from_calendar_years():
    """A parabola over 2000 to 2030, told in 2040: T_2(5/3)^2, Chebyshev's polynomial."""

    def rows(x):
        return np.vander(x[:, 0], 3, increasing=True)

    forecast = criteria.create("c", c=[1.0, 2040.0, 2040.0**2])
    value = (2 * (5 / 3) ** 2 - 1) ** 2
    r = relax_region(Region(rows, 2000, 2030), forecast)
    assert r.cost == pytest.approx(value, rel=GAP)
    assert r.gap <= GAP
    np.testing.assert_allclose(r.points.ravel(), [2000, 2015, 2030], atol=0.01)
