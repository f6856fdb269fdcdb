"""Textbook optima for a part of the parameters: Elfving, Chebyshev points, contrasts, blocks."""

from itertools import product

import numpy as np
import pytest

import criteria
from edtk.design.exact.apportion import best_repeats
from edtk.design.exact.exchange import exchange
from edtk.design.problem import Problem, RankDeficientError
from edtk.design.relaxation.relax import relax

GAP = 1e-6
MONOTONE = ("A", "D", "E", "G", "O1", "O3", "O5")

every = pytest.mark.parametrize("name", MONOTONE)


def polynomial(degree, more=()):
    """Candidates x and the problem of a polynomial on [-1, 1], with given points among them."""
    x = np.unique(np.append(np.linspace(-1, 1, 41), more))
    return x, Problem(np.vander(x, degree + 1, increasing=True)[:, None])


def check(problem, criterion, cost, weights):
    """Cost, certificate and weights of an optimum that is known."""
    r = relax(problem, criterion)
    assert abs(r.gap) <= GAP
    assert r.cost == pytest.approx(cost, rel=GAP)
    assert r.proved_bound.cost <= cost * (1 + 1e-9)
    np.testing.assert_allclose(r.weights, weights, atol=2 * np.sqrt(GAP))
    # The certificate stands on its own: multiplier and sensitivities of the problem as given.
    largest = problem.sensitivities(r.multipliers).max(axis=-1)
    M = problem.information(r.weights)
    assert criterion.lower_bound(r.multipliers, largest, M) == pytest.approx(r.proved_bound.cost)
    return r


@pytest.mark.parametrize("degree", [2, 3, 4])
@pytest.mark.parametrize("name", ["A", "D"])
def test_highest_coefficient(name, degree):
    """D_s for the leading coefficient: Chebyshev points, weights 1/2d at the ends, 1/d between.

    The variance is the square of the leading coefficient ``2^(d-1)`` of the Chebyshev polynomial.
    """
    support = -np.cos(np.arange(degree + 1) * np.pi / degree)
    x, problem = polynomial(degree, support)
    r = relax(problem, criteria.create(name, interest=np.eye(degree + 1)[-1]))
    assert abs(r.gap) <= GAP
    assert r.cost == pytest.approx(4.0 ** (degree - 1), rel=GAP)
    # A support point and a point of the grid may be one but for rounding.
    near = [r.weights[np.abs(x - point) < 1e-9].sum() for point in support]
    inside = np.ones(degree - 1) / degree
    expected = [0.5 / degree, *inside, 0.5 / degree]
    np.testing.assert_allclose(near, expected, atol=2 * np.sqrt(GAP))


def test_extrapolation_of_a_quadratic():
    """Elfving: the value at z = 2 has the variance T_2(2)^2 = 49, weights |l_i(z)| = 1, 3, 3."""
    _, problem = polynomial(2)
    weights = np.zeros(41)
    weights[[0, 20, 40]] = np.array([1, 3, 3]) / 7
    check(problem, criteria.create("A", interest=[1.0, 2.0, 4.0]), 49.0, weights)


@pytest.mark.parametrize(
    ("K", "variance", "support"),
    [
        ([0, 1, 0], 1.0, {-1.0: 0.5, 1.0: 0.5}),
        ([1, 0, 0], 1.0, {0.0: 1.0}),
        ([1, 0.5, 0.25], 1.0, {0.5: 1.0}),
        ([0, 1, 1], 4.0, {0.0: 0.5, 1.0: 0.5}),
    ],
    ids=["slope at 0", "value at 0", "value at 1/2", "difference of values"],
)
@every
def test_singular_optima_of_a_quadratic(name, K, variance, support):
    """One or two points are best for a value inside, or the slope in the middle: M is singular.

    The variance of a single combination is that of every criterion, up to its power.
    """
    x, problem = polynomial(2)
    weights = np.array([next((w for p, w in support.items() if abs(v - p) < 1e-9), 0) for v in x])
    criterion = criteria.create(name, interest=K)
    r = check(problem, criterion, variance**criterion.degree, weights)
    assert np.count_nonzero(r.weights) == len(support)


@pytest.mark.parametrize("t", [3, 4, 9])
def test_treatments_against_a_control(t):
    """A for the contrasts with a control: the control has sqrt(t) times the others' weight.

    With a general mean beside t + 1 effects, no candidate tells an effect itself: every M is
    singular. The variances sum to ``(t + sqrt(t))^2``.
    """
    A = np.zeros((t + 1, 1, t + 2))
    A[:, 0, 0] = 1
    A[np.arange(t + 1), 0, 1 + np.arange(t + 1)] = 1
    K = np.zeros((t + 2, t))
    K[1] = 1
    K[2 + np.arange(t), np.arange(t)] = -1
    weights = np.array([np.sqrt(t), *np.ones(t)]) / (t + np.sqrt(t))
    criterion = criteria.create("A", interest=K)
    check(Problem(A), criterion, (t + np.sqrt(t)) ** 2, weights)


def two_way(t, b):
    """The additive model of t treatments in b blocks, one effect each."""
    A = np.zeros((t * b, 1, t + b))
    for n, (i, j) in enumerate(product(range(t), range(b))):
        A[n, 0, [i, t + j]] = 1
    return Problem(A)


def contrasts(t, b):
    """Orthonormal contrasts of the treatments (t + b, t - 1), blocks being nuisance."""
    U = np.linalg.svd(np.eye(t) - 1 / t)[0][:, : t - 1]
    return np.vstack([U, np.zeros((b, t - 1))])


@every
def test_contrasts_of_treatments_in_blocks(name):
    """The uniform design is best for all contrasts: C_K = I/t, whatever the blocks are."""
    t = 4
    criterion = criteria.create(name, interest=contrasts(t, 2))
    cost = criteria.create(name).cost(np.eye(t - 1) / t)
    r = relax(two_way(t, 2), criterion)
    assert abs(r.gap) <= GAP
    assert r.cost == pytest.approx(cost, rel=GAP)


def test_what_the_candidates_cannot_tell_is_named():
    """A treatment's own effect is not estimable beside those of the blocks; a contrast is."""
    problem = two_way(2, 2)
    for K, named in (([1, 0, 0, 0], "k1 \\(open: "), ([1, 0, -1, 0], "k1 - k3 \\(open: ")):
        with pytest.raises(RankDeficientError, match=f"no candidate tells {named}") as caught:
            relax(problem, criteria.create("A", interest=K))
        assert "\n" not in str(caught.value)
    assert relax(problem, criteria.create("A", interest=[1, -1, 0, 0])).cost == pytest.approx(4)


def test_prior_information_makes_a_combination_estimable():
    """Beside a prior about the blocks the effect of a treatment is known."""
    problem = two_way(2, 2)
    prior = np.diag([0, 0, 1.0, 1.0])
    known = Problem.of_information(problem.packed, prior=prior)
    r = relax(known, criteria.create("A", interest=[1, 0, 0, 0]))
    assert abs(r.gap) <= GAP
    M = known.information(r.weights)
    assert r.cost == pytest.approx(np.linalg.pinv(M)[0, 0], rel=1e-9)


@pytest.mark.parametrize("name", ["A", "D", "E"])
def test_exact_plan_of_the_highest_coefficient(name):
    """Exchange and redistribution find the best four points of eleven: -1, 0, 0, 1."""
    x = np.linspace(-1, 1, 11)
    problem = Problem(np.vander(x, 3, increasing=True)[:, None])
    criterion = criteria.create(name, interest=[0, 0, 1.0])
    places, cost = exchange(problem, criterion, start=[1, 3, 4, 8])
    assert cost == pytest.approx(1.0)
    np.testing.assert_allclose(np.sort(x[places]), [-1, 0, 0, 1], atol=1e-12)
    repeats = best_repeats(criterion, problem.blocks([0, 5, 10]), np.array([6.0, 1.0, 1.0]))
    np.testing.assert_array_equal(repeats, [2, 4, 2])


def test_exchange_reaches_singular_plans():
    """Two experiments tell the difference of two treatments although the blocks stay unknown."""
    problem = two_way(2, 2)
    criterion = criteria.create("A", interest=[1, -1, 0, 0])
    places, cost = exchange(problem, criterion, start=[0, 0])
    assert cost == pytest.approx(2.0)
    assert sorted(places) in ([0, 2], [1, 3])
