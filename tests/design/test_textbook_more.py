"""More optima in closed form: weighted polynomials, canonical moments, exact plans, blocks."""

from itertools import product
from math import log

import numpy as np
import pytest
from scipy.special import roots_genlaguerre, roots_hermite, roots_jacobi

import criteria
import edtk

ACCURACY = 1e-6


def rows(F, **options):
    """A problem of one row an experiment."""
    return edtk.Problem(np.asarray(F, dtype=float)[:, None, :], **options)


def close(found, value):
    """The value is that of theory, and the bound is valid and close to it."""
    sign = 1 if found.criterion.sense == "max" else -1
    assert found.value == pytest.approx(value, rel=ACCURACY)
    assert found.bound == pytest.approx(value, rel=2 * ACCURACY)
    assert sign * (found.bound / value - 1) > -1e-9


def best(plan, value):
    """The plan has the value of theory, and its bound is no worse."""
    sign = 1 if plan.criterion.sense == "max" else -1
    assert plan.value == pytest.approx(value, rel=1e-9)
    assert sign * (plan.bound / value - 1) > -1e-9


def evenly(F):
    """``det(M)^(1/p)`` of equal weights on p points with rows F (p, p)."""
    p = len(F)
    return abs(np.linalg.det(F)) ** (2 / p) / p


@pytest.mark.parametrize(
    ("weight", "low", "high", "nodes"),
    [
        (lambda x: np.exp(-x), 0, 40, np.append(0.0, roots_genlaguerre(2, 1)[0])),
        (lambda x: np.exp(-(x**2)), -8, 8, roots_hermite(3)[0]),
        (lambda x: (1 - x) ** 2 * (1 + x) ** 1.5, -1, 1, roots_jacobi(3, 1, 0.5)[0]),
    ],
    ids=["Laguerre", "Hermite", "Jacobi"],
)
def test_weighted_parabolas(weight, low, high, nodes):
    """D of a parabola with the weights of classical polynomials: their roots (Fedorov 1972)."""

    def model(x):
        return np.sqrt(weight(x)) * np.vander(x[:, 0], 3, increasing=True)

    close(edtk.relax(edtk.Region(model, low, high), "D"), evenly(model(nodes[:, None])))


def determinant(moments, degree):
    """Det M of a polynomial on [-1, 1] by its even canonical moments (Dette and Studden 1997)."""
    even = {0: 0.0, **moments}
    found = 1.0
    for j in range(1, degree + 1):
        found *= ((1 - even[j - 1]) * even[j]) ** (degree + 1 - j)
    return found


@pytest.mark.parametrize(("degree", "s"), [(3, 2), (4, 3), (5, 2)])
def test_the_highest_coefficients(degree, s):
    """D_s for the s highest coefficients, by canonical moments (Studden 1980)."""
    low = degree - s
    moments = {
        j: 0.5 if j <= low else (degree - j + 1) / (2 * (degree - j) + 1) for j in range(1, degree)
    }
    moments[degree] = 1.0
    value = (determinant(moments, degree) / determinant(moments, low)) ** (1 / s)
    region = edtk.Region(lambda x: np.vander(x[:, 0], degree + 1, increasing=True), -1, 1)
    criterion = criteria.create("Ds", interest=np.eye(degree + 1)[:, low + 1 :])
    close(edtk.relax(region, criterion), value)


def test_one_design_for_polynomials_of_several_degrees():
    """The compound of D for the degrees 1 to 3, by canonical moments (Lau and Studden 1985)."""
    share = {degree: 1 / (3 * (degree + 1)) for degree in (1, 2, 3)}
    moments = {3: 1.0}
    for j in (1, 2):
        ups = sum(share[degree] * (degree + 1 - j) for degree in range(j, 4))
        downs = sum(share[degree] * (degree - j) for degree in range(j + 1, 4))
        moments[j] = ups / (ups + downs)
    value = np.exp(sum(share[d] * log(determinant(moments, d)) for d in share))
    x = np.cos(np.linspace(0, np.pi, 40001))  # of 4001 points the best is 5e-8 worse
    models = [rows(np.vander(x, d + 1, increasing=True)) for d in share]
    criterion = criteria.create("compound", criteria=["D"] * 3, sizes=[2, 3, 4])
    found = edtk.relax(edtk.several_models(models), criterion)
    close(found, value if criterion.sense == "max" else 1 / value)


@pytest.mark.parametrize("q", [0, 0.5, 1, 3])
def test_contrasts_of_treatments_under_phi(q):
    """All means of the eigenvalues agree where they are equal: t for orthonormal contrasts."""
    t, b = 5, 3
    F = [np.append(np.eye(t)[i], np.eye(b)[j]) for i in range(t) for j in range(b)]
    contrasts = np.linalg.qr(np.column_stack([np.ones(t), np.eye(t)[:, 1:]]))[0][:, 1:]
    K = np.vstack([contrasts, np.zeros((b, t - 1))])
    close(edtk.relax(rows(F), criteria.create("phi", q=q, interest=K)), t)


def test_a_far_prediction_is_the_largest_variance():
    """G of predictions on [-1, 2] from [-1, 1]: that at 2, of weights 1/4 and 3/4, is 4."""
    x = np.linspace(-1, 1, 41)
    z = np.linspace(-1, 2, 31)
    criterion = criteria.create("prediction_G", points=np.vander(z, 2))
    close(edtk.relax(rows(np.vander(x, 2)), criterion), 4.0)


@pytest.mark.parametrize("q", [2, 5])
def test_mean_predictions_of_first_order_mixtures(q):
    """I over the whole simplex, E x_i^2 = 2/q(q+1): 2q/(q + 1) from equal weights on vertices."""
    W = (np.ones((q, q)) + np.eye(q)) / (q * (q + 1))
    mixtures = [point for point in product(range(5), repeat=q) if sum(point) == 4]
    close(edtk.relax(rows(np.array(mixtures) / 4), criteria.create("I", W=W)), 2 * q / (q + 1))


def test_units_twenty_seven_decades_apart():
    """A parabola in silly units has the optima of the plain one, times the units."""
    x = np.linspace(-1, 1, 21)
    problem = rows(np.vander(x, 3, increasing=True) * [1e-12, 1, 1e15])
    close(edtk.relax(problem, "D"), (4 / 27 * 1e6) ** (1 / 3))
    close(edtk.relax(problem, criteria.create("c", c=[1e-12, 2, 4e15])), 49.0)


@pytest.mark.parametrize(("n", "largest"), [(5, 48), (6, 160), (7, 576)])
def test_largest_determinants_of_signs(n, largest):
    """Of n x n matrices of +-1 (Hadamard's problem where there is no Hadamard matrix)."""
    corners = np.array(list(product((-1, 1), repeat=n - 1)))
    best(edtk.plan(rows(np.column_stack([np.ones(len(corners)), corners])), n), largest ** (2 / n))


@pytest.mark.parametrize(("n", "largest"), [(4, 3), (5, 5), (6, 9)])
def test_largest_determinants_of_zeros_and_ones(n, largest):
    """A spring balance with as many weighings as objects."""
    choices = np.array(list(product((0, 1), repeat=n)))[1:]
    best(edtk.plan(rows(choices), n), largest ** (2 / n))


@pytest.mark.slow
@pytest.mark.parametrize("n", [5, 9])
def test_weighings_one_more_than_a_multiple_of_four(n):
    """Chemical balance of p objects, n = 1 mod 4: X'X = (n - 1) I + J for D and A (Cheng 1980)."""
    p = 4
    problem = rows(list(product((-1, 1), repeat=p)))
    best(edtk.plan(problem, n), ((n - 1) ** (p - 1) * (n - 1 + p)) ** (1 / p))
    best(edtk.plan(problem, n, "A"), (p - 1) / (n - 1) + 1 / (n - 1 + p))


@pytest.mark.parametrize(("v", "b", "k"), [(4, 6, 2), (7, 7, 3)])
def test_balanced_incomplete_blocks(v, b, k):
    """Of v treatments in b blocks of k, each pair is together equally often (Kiefer 1958)."""
    pairs = b * k * (k - 1) / (v * (v - 1))
    treatments = rows(np.vstack([np.eye(v - 1), np.zeros((1, v - 1))]))
    found = edtk.plan(treatments, blocks=(k,) * b, starts=8)
    best(found, ((pairs * v / k) ** (v - 1) / v) ** (1 / (v - 1)))


def test_as_much_money_for_each_parameter():
    """D with costs: every parameter gets the same part of the budget."""
    prices = np.array([1.0, 2.0, 4.0, 8.0])
    found = edtk.plan(rows(np.eye(4)), costs=prices, cost_budget=32.0, starts=16)
    assert found.counts.tolist() == [8, 4, 2, 1]
    best(found, np.prod(8 / prices) ** (1 / 4))
