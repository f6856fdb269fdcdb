"""Criteria of extreme eigenvalues over a few candidates, by a method for semidefinite programs."""

import numpy as np
import pytest
from matrices import semidefinite
from relaxations import blocks_of, off_centre

import criteria
from criteria.spectral_balance import SpectralBalance
from edtk.design.problem import Problem
from edtk.design.relaxation.master_equations import ActiveInformation
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.restricted_master import SolverOptions
from edtk.design.relaxation.spectral_weights import spectral_weights

ACCURACY = 1e-8
CRITERIA = {
    "E": criteria.create("E"),
    "O2": criteria.create("O2"),
    "both": SpectralBalance(0.5, 2.0),
    "lower bound alone": SpectralBalance(0.0, 3.0),
    "E of two": criteria.create("E", interest=np.eye(4)[:, :2]),
}


@pytest.mark.parametrize("rows", [1, 3])
@pytest.mark.parametrize("name", CRITERIA)
def test_proof(name, rows):
    """The multiplier proves that no weights are better, to the accuracy asked for."""
    criterion = CRITERIA[name]
    problem = Problem(blocks_of(rows, 40, rows) + np.array([1.0, 0.5, 0.0, 0.0]))
    problem = problem.with_unit_trace() if criterion.degree == 0 else problem
    active = ActiveInformation.of(problem, np.arange(problem.n))
    weights, Z = spectral_weights(criterion.spectral_band(4), active, np.full(40, 1 / 40), ACCURACY)
    assert (weights > 0).all()
    assert weights.sum() == pytest.approx(1)
    M = problem.information(weights)
    Z = semidefinite(Z, M) if criterion.monotone else Z
    bound = criterion.lower_bound(Z[None], problem.sensitivities(Z).max(keepdims=True), M)
    cost = float(criterion.cost(M))
    assert (1 - 10 * ACCURACY) * cost <= bound <= (1 + 1e-12) * cost


@pytest.mark.parametrize("name", ["E", "O2", "O3", "O4"])
def test_same_as_cvxpy(name):
    """The relaxation by this method has the cost of the one by cvxpy's."""
    problem = Problem(off_centre(8, 300))
    criterion = criteria.create(name)
    own = relax(problem, criterion, options=SolverOptions(solvers=("NEWTON",)))
    other = relax(problem, criterion, options=SolverOptions(solvers=("CLARABEL",)))
    assert own.gap <= 1e-6
    assert own.cost == pytest.approx(other.cost, rel=1e-6)


def test_transformed():
    """As a function of other parameters the program has the same weights."""
    T = np.random.default_rng(0).normal(size=(4, 4))
    problem = Problem(off_centre(8, 30))
    other = Problem(off_centre(8, 30) @ T)
    plain = relax(problem, criteria.create("E"))
    found = relax(other, criteria.create("E").transformed(T))
    assert found.solver == "NEWTON"
    assert found.cost == pytest.approx(plain.cost, rel=1e-6)


def test_smoothed_has_none():
    """A smoothed criterion is another program."""
    assert criteria.create("E").smoothed(10.0).spectral_band(4) is None
    assert criteria.create("O3").smoothed(10.0).spectral_band(4) is None
    assert criteria.create("O2").smoothed(10.0).spectral_band(4) is None
    assert criteria.create("G").spectral_band(4) is None
    assert criteria.create("D").spectral_band(4) is None


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("name", ["E", "O4"])
def test_a_candidate_that_tells_nothing(name, p):
    """A candidate of zeros limits no multiplier, and gets no weight, without a word of overflow."""
    blocks = np.random.default_rng(0).normal(size=(20, 2, p)) * 1e11
    blocks[4] = 0.0
    found = relax(Problem(blocks), criteria.create(name))
    assert found.solver == "NEWTON"
    assert found.gap <= 1e-6
    assert found.weights[4] == 0
