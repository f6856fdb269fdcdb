"""What a multiplier proves over the candidates."""

import numpy as np
import pytest
from relaxations import off_centre

import criteria
import edtk
from edtk.design.problem import Problem
from edtk.design.relaxation.proof import Proof


def test_gradient_of_a_smooth_criterion():
    """Without a multiplier minus the gradient proves the bound of the equivalence theorem."""
    problem = Problem(off_centre(8, 50))
    M = problem.mean
    cost, G = criteria.create("D").cost_and_gradient(M)
    proof, sensitivities = Proof.of(problem, criteria.create("D"), M, [-G])
    own = problem.sensitivities(np.linalg.inv(M))
    assert proof.lower_bound == pytest.approx(cost * 4 / own.max())
    np.testing.assert_allclose(sensitivities / sensitivities.max(), own / own.max())


def test_worthless_multiplier():
    """A solver's multiplier that proves nothing has the bound zero, or the gradient's."""
    problem = Problem(off_centre(8, 50))
    Z = -np.eye(4)
    assert Proof.of(problem, criteria.create("E"), problem.mean, [Z])[0].lower_bound == 0.0
    G = criteria.create("A").gradient(problem.mean)
    alone, _ = Proof.of(problem, criteria.create("A"), problem.mean, [-G])
    both, _ = Proof.of(problem, criteria.create("A"), problem.mean, [Z, -G])
    assert both.lower_bound == alone.lower_bound > 0


def test_enough_is_proved():
    """A multiplier that proves enough is the last one tried; of several the best one counts."""
    problem = Problem(off_centre(8, 50))
    G = criteria.create("D").gradient(problem.mean)
    best = edtk.relax(problem, "D").multipliers[0]
    first, _ = Proof.of(problem, criteria.create("D"), problem.mean, [-G, best], enough=1e-9)
    every, _ = Proof.of(problem, criteria.create("D"), problem.mean, [-G, best])
    np.testing.assert_allclose(first.multiplier, -G)
    assert every.lower_bound > first.lower_bound > 0


def test_rounding_of_a_parameter_without_sensitivity():
    """It becomes zero, which no units can make as large as the others, and the bound is valid."""
    rows = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])[:, None, :]
    problem = Problem(rows)
    z = np.array([0.0, 3.0, -4.0])
    Z = np.outer(z, z) + 1e-16 * np.diag([1.0, 0, 0])
    Z[0, 1] = Z[1, 0] = 1e-15
    proof, _ = Proof.of(problem, criteria.create("E"), problem.mean, [Z])
    assert (proof.multiplier[0] == 0).all()
    assert (proof.multiplier[:, 0] == 0).all()
    np.testing.assert_allclose(proof.multiplier, np.outer(z, z), atol=1e-14)


def test_a_design_without_a_gradient():
    """Where M is all but singular the gradient is no number; something is proved all the same."""
    problem = Problem(off_centre(8, 50))
    criterion = criteria.create("D")
    M = problem.mean / np.sqrt(np.outer(problem.mean.diagonal(), problem.mean.diagonal()))
    M[-1, :-1] = M[:-1, -1] = M[0, :-1]
    M[-1, -1] = 1.0 + 1e-15
    G = criterion.gradient(M)
    assert np.isnan(G).all()
    proof, sensitivities = Proof.of(problem, criterion, M, [-G])
    assert np.isfinite(sensitivities).all()
    assert 0 < proof.lower_bound <= criterion.cost(problem.mean)
