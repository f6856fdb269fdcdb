"""One design for several models: textbook optima, and the block diagonal problem."""

import numpy as np
import pytest
from scipy.optimize import brentq

import criteria
import edtk
from edtk.design.problem import Problem
from edtk.design.problems import several_models
from edtk.design.relaxation.relax import relax
from edtk.system.errors import ArgumentError

X = np.linspace(-1, 1, 41)
LINE = Problem(np.vander(X, 2, increasing=True)[:, None, :])
PARABOLA = Problem(np.vander(X, 3, increasing=True)[:, None, :])
BOTH = several_models([LINE, PARABOLA])
# Best values of D: det^(1/p) of weights 1/2, 1/2 and of 1/3, 1/3, 1/3.
BEST = [1.0, (4 / 27) ** (1 / 3)]


def check(problem, criterion, cost, weights, accuracy=1e-6):
    """Cost, valid bound and weights of a relaxation."""
    r = relax(problem, criterion)
    assert r.cost == pytest.approx(cost, rel=accuracy)
    assert cost * (1 - accuracy) <= r.proved_bound.cost <= r.cost * (1 + 1e-9)
    np.testing.assert_allclose(r.weights[r.weights > 1e-4], weights, atol=1e-3)


def test_compound_of_d_for_a_line_and_a_parabola():
    """With u on -1 and 1 the log of the product is ``7/24 log u + 1/6 log(1 - u)``: u = 7/9.

    That is a mean of ``log u / 2`` for the line and ``(2 log u + log(1 - u))/3`` for the parabola.
    """
    u = 7 / 9
    losses = np.array([1 / u**0.5, BEST[1] / (u**2 * (1 - u)) ** (1 / 3)])
    c = criteria.create("compound", criteria=["D", "D"], sizes=[2, 3], best=BEST)
    check(BOTH, c, np.sqrt(losses.prod()), [u / 2, 1 - u, u / 2])


def test_minimax_of_d_for_a_line_and_a_parabola():
    """The two efficiencies are the same at the optimum."""
    u = brentq(lambda u: u**0.5 - (u**2 * (1 - u)) ** (1 / 3) / BEST[1], 0.7, 0.99, xtol=1e-14)
    c = criteria.create("minimax", criteria=["D", "D"], sizes=[2, 3], best=BEST)
    check(BOTH, c, u**-0.5, [u / 2, 1 - u, u / 2])


@pytest.mark.slow
def test_minimax_of_predictions_at_two_points():
    """Predictions at 1 and 0 alone: half of the experiments at each, and a singular design."""
    at = [criteria.create("c", c=[1, 1, 1]), criteria.create("c", c=[1, 0, 0])]
    r = relax(PARABOLA, criteria.create("minimax", criteria=at))
    assert r.cost == pytest.approx(2.0, rel=1e-6)
    assert r.proved_bound.cost >= 2.0 * (1 - 1e-6)


def test_bayesian_d_of_independent_parameters():
    """Rows ``a_i e_i`` with a prior: weights fill up what is known least, until they run out.

    ``prod (w_i a_i^2 + r_i)`` is largest, by Lagrange, where ``w_i + r_i/a_i^2`` is the same for
    all that have weight: 0.25 and 1.25 of the prior leave 0.75 + 0.5 = 1.25 for both.
    """
    problem = Problem(np.diag([1.0, 2.0, 1.0])[:, None, :])
    prior = np.diag([0.25, 2.0, 5.0])
    level = (1 + 0.25 + 0.5) / 2
    cost = (level * level * 4 * 5.0) ** (-1 / 3)
    check(problem, criteria.create("bayes_D", precision=prior), cost, [level - 0.25, level - 0.5])
    # Twelve experiments share twelve times the prior.
    shared = edtk.relax(problem, criteria.create("bayes_D", precision=12 * prior), size=12)
    assert shared.cost == pytest.approx(cost, rel=1e-6)


def test_bayesian_a_of_independent_parameters():
    """``sum 1/(w_i + r_i)`` is least where all sums are the same."""
    problem = Problem(np.eye(2)[:, None, :])
    c = criteria.create("bayes_A", precision=np.diag([0.2, 0.4]))
    check(problem, c, 2 / 0.8, [0.6, 0.4])
    r = relax(problem, c)
    cost, bound = r.certify(problem)
    assert cost == pytest.approx(2.5, rel=1e-6)
    assert bound == pytest.approx(2.5, rel=1e-6)


def test_a_prior_alone_may_be_enough():
    """Where the prior knows a parameter that no candidate excites, the design is found."""
    problem = Problem(np.array([[[1.0, 0.0]], [[2.0, 0.0]]]))
    r = relax(problem, criteria.create("bayes_A", precision=np.eye(2)))
    assert r.cost == pytest.approx(1 / 5 + 1, rel=1e-6)


def test_models_are_blocks_of_one_matrix():
    """The information is block diagonal, priors and names included."""
    known = Problem(LINE.factors(), parameters=("a", "b"), prior=np.eye(2))
    other = Problem(PARABOLA.factors(), parameters=("a", "c", "d"))
    both = several_models([known, other])
    w = np.random.default_rng(0).dirichlet(np.ones(41))
    M = both.information(w)
    np.testing.assert_allclose(M[:2, :2], known.information(w), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(M[2:, 2:], other.information(w), rtol=1e-12, atol=1e-15)
    assert not M[:2, 2:].any()
    assert both.parameters == ("a (1)", "b", "a (2)", "c", "d")


@pytest.mark.parametrize("problems", [[], [LINE, LINE[np.arange(3)]]])
def test_models_of_other_candidates_are_refused(problems):
    """One line says what was expected."""
    with pytest.raises(ArgumentError, match=r"problems: .*expected"):
        several_models(problems)
