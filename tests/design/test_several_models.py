"""One design for several models: textbook optima, and the block diagonal problem."""

import json

import numpy as np
import pytest
from scipy.optimize import brentq

import criteria
import edtk
from edtk.certificate.verify_problem import verify_problem
from edtk.design.information import ModelRows, Rows
from edtk.design.problem import Problem, several_models
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


def test_rows_of_models_are_rows_with_zeros_between():
    """What models keep apart says the same as rows of all parameters, in every sum over them."""
    rng = np.random.default_rng(5)
    shapes = [(2, 3), (1, 2), (2, 3)]
    parts = [Rows(rng.normal(size=(7, *shape))) for shape in shapes]
    models = ModelRows(parts)
    whole = Rows(models.A)
    roots = rng.normal(size=(2, 8, 8))
    Z = roots @ np.swapaxes(roots, 1, 2)
    w = rng.random(7)
    some = np.array([4, 1])
    T = models.models.diagonal([rng.normal(size=(s, s)) for _, s in shapes])
    pairs = [
        (models.sensitivities(Z), whole.sensitivities(Z * _apart(models))),
        (models.weighted(w), whole.weighted(w)),
        (models.mean(), whole.mean()),
        (models.blocks(some), whole.blocks(some)),
        (models.sensitivities_to_root(T), whole.sensitivities_to_root(T)),
        (models.diagonals(), whole.diagonals()),
        (models.times(T).A, whole.times(T).A),
        (models[some].A, whole[some].A),
        ((models + models[some]).A, (whole + whole[some]).A),
    ]
    for own, expected in pairs:
        np.testing.assert_allclose(own, expected, rtol=1e-12, atol=1e-13)


def _apart(models):
    """Ones in the blocks, zeros beside them."""
    return np.where(models.models.outside, 0.0, 1.0)


def test_sizes_ask_for_models_side_by_side():
    """Information between models is an error of one line, and not a wrong number."""
    both = criteria.create("minimax", criteria=["D", "D"], sizes=[1, 1])
    with pytest.raises(criteria.CriterionError, match="expected information of several_models"):
        both.cost(np.array([[2.0, 1.0], [1.0, 2.0]]))


@pytest.mark.parametrize("kind", ["compound", "minimax"])
def test_bounds_of_many_models_hold_in_the_second_implementation(kind):
    """Logits at nine slopes and middles: the certificate is recomputed from the rows alone."""
    x = np.linspace(-4, 4, 61)
    models = []
    for slope in (0.5, 1.0, 2.0):
        for middle in (-1.0, 0.0, 1.0):
            u = slope * (x - middle)
            rows = (
                np.column_stack([x - middle, np.full(61, -slope)]) / (2 * np.cosh(u / 2))[:, None]
            )
            models.append(Problem(rows[:, None, :]))
    problem = several_models(models)
    criterion = criteria.create(kind, criteria=["D"] * 9, sizes=[2] * 9)
    found = edtk.relax(problem, criterion)
    assert found.proved_bound.gap <= 1e-6
    assert verify_problem(json.loads(json.dumps(found.to_dict())), problem).valid


@pytest.mark.slow
def test_plans_of_models_in_distant_units_are_those_in_good_ones():
    """The search works in parameters of each model, which units do not change."""
    units = np.array([1.0, 1e4, 1e-4])
    far = Problem(PARABOLA.factors() * units)
    criterion = criteria.create("compound", criteria=["D", "D"], sizes=[2, 3])
    near, other = (
        edtk.plan(several_models([LINE, one])[::5], size=6, criterion=criterion)
        for one in (PARABOLA, far)
    )
    assert near.counts.tolist() == other.counts.tolist() == [2, 0, 0, 0, 2, 0, 0, 0, 2]
