"""The largest of several variances over a few candidates, by an interior point method."""

import numpy as np
import pytest
from matrices import make, semidefinite
from relaxations import blocks_of, off_centre

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.master_equations import ActiveInformation
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.restricted_master import SolverOptions
from edtk.design.relaxation.spectral_weights import spectral_weights
from edtk.design.relaxation.variance_weights import variance_weights

ACCURACY = 1e-8
CRITERIA = {
    "G": criteria.create("G"),
    "rho_max": make("rho_max", 4),
    "G of two": criteria.create("G", interest=np.eye(4)[:, :2]),
}


@pytest.mark.parametrize("rows", [1, 3])
@pytest.mark.parametrize("name", CRITERIA)
def test_proof(name, rows):
    """The multiplier proves that no weights are better, to the accuracy asked for."""
    criterion = CRITERIA[name]
    problem = Problem(blocks_of(rows, 40, rows) + np.array([1.0, 0.5, 0.0, 0.0]))
    active = ActiveInformation.of(problem, np.arange(problem.n))
    weights, Z = variance_weights(criterion.variance_rows(4), active, np.full(40, 1 / 40), ACCURACY)
    assert (weights > 0).all()
    assert weights.sum() == pytest.approx(1)
    M = problem.information(weights)
    Z = semidefinite(Z, M)
    bound = criterion.lower_bound(Z[None], problem.sensitivities(Z).max(keepdims=True), M)
    cost = float(criterion.cost(M))
    assert (1 - 10 * ACCURACY) * cost <= bound <= (1 + 1e-12) * cost


@pytest.mark.parametrize("name", ["G", "rho_max"])
def test_same_as_cvxpy(name):
    """The relaxation by this method has the cost of the one by cvxpy's."""
    problem = Problem(off_centre(8, 300))
    criterion = make(name, 4)
    own = relax(problem, criterion, options=SolverOptions(solvers=("NEWTON",)))
    other = relax(problem, criterion, options=SolverOptions(solvers=("CLARABEL",)))
    assert own.gap <= 1e-6
    assert own.cost == pytest.approx(other.cost, rel=1e-6)


def test_kiefer_and_wolfowitz():
    """Over all candidates the largest variance of a prediction is p, where D is best."""
    rows = np.vander(np.linspace(-1, 1, 101), 4, increasing=True)
    found = relax(Problem(rows[:, None, :]), criteria.create("prediction_G", points=rows))
    assert found.solver == "NEWTON"
    assert found.cost == pytest.approx(4.0, rel=1e-6)
    assert found.gap <= 1e-6


@pytest.mark.parametrize("name", ["G", "rho_max", "E"])
def test_a_start_from_an_exact_answer(name):
    """An answer on the boundary is one to go on from: weights and slacks of zero become positive.

    With rows ``e_i``, ``e_i/2`` and 0 in four parameters, weights 1/4 on the first four are best
    for each criterion that asks for the same variance of all, and the identity is the multiplier.
    """
    rows = np.vstack([np.eye(4), 0.5 * np.eye(4), np.zeros((1, 4))])
    active = ActiveInformation.of(Problem(rows[:, None, :]), np.arange(9))
    best = np.repeat([0.25, 0.0], [4, 5])
    if name == "E":
        band = criteria.create("E").spectral_band(4)
        weights, Z = spectral_weights(band, active, best, ACCURACY, np.eye(4))
    else:
        own = {"G": criteria.create("G").variance_rows(4), "rho_max": np.eye(4)[:, None, :]}[name]
        weights, Z = variance_weights(own, active, best, ACCURACY, np.eye(4))
    assert (weights > 0).all()
    assert weights == pytest.approx(best, abs=ACCURACY)
    assert active.sensitivities(Z) == pytest.approx(active.sensitivities(np.eye(4)), abs=1e-6)


def test_smoothed_has_none():
    """A smoothed criterion is another program."""
    assert make("G", 4).smoothed(10.0).variance_rows(4) is None
    assert make("rho_max", 4).smoothed(10.0).variance_rows(4) is None
    assert make("E", 4).variance_rows(4) is None
