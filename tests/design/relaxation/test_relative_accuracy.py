"""The accuracy that is told for a cost and a bound."""

import numpy as np
import pytest

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.proof import errors

RNG = np.random.default_rng(0)
PROBLEM = Problem(RNG.normal(size=(20, 2, 3)))
WEIGHTS = np.full(20, 0.05)


def of(problem, name="A", **options):
    """The accuracy of equal weights and of their gradient's bound."""
    criterion = criteria.create(name)
    M = problem.information(WEIGHTS)
    return sum(errors(problem, criterion, WEIGHTS, -criterion.gradient(M)[None], **options))


@pytest.mark.parametrize("name", ["A", "D", "E", "O2", "O4", "O5"])
def test_well_conditioned_numbers_are_good_to_twelve_digits(name):
    """Without wrong rows only roundings remain."""
    assert 0 < of(PROBLEM, name) < 1e-12


@pytest.mark.parametrize("of_squares", [False, True])
@pytest.mark.parametrize("name", ["A", "D", "E"])
def test_wrong_rows_change_numbers_by_less(of_squares, name):
    """Rows, or squares, that are wrong by e change cost and bound by less than is told."""
    criterion = criteria.create(name)
    e = 1e-6
    told = of(PROBLEM, name, rounding=np.full(20, e), of_squares=of_squares)
    assert told < 1e-3
    M = PROBLEM.information(WEIGHTS)
    Z = -criterion.gradient(M)
    t = PROBLEM.sensitivities(Z).max()
    for seed in range(10):
        noise = np.random.default_rng(seed).normal(size=(20, 2, 3))
        noise *= e / np.linalg.norm(noise, axis=(1, 2), keepdims=True)
        if of_squares:
            wrong = PROBLEM.blocks() + np.swapaxes(noise, 1, 2) @ noise / e
        else:
            A = PROBLEM.factors() + noise
            wrong = np.swapaxes(A, 1, 2) @ A
        cost = float(criterion.cost(np.tensordot(WEIGHTS, wrong, axes=1)))
        top = np.einsum("ij,nij->n", Z, wrong).max()
        change = abs(np.log(cost / criterion.cost(M))) + abs(np.log(top / t))
        assert change <= told


def test_units_of_the_parameters_do_not_matter():
    """Parameters in other units have the same roundings, so that D has the same accuracy."""
    scaled = Problem(PROBLEM.factors() * np.array([1e-8, 1.0, 1e6]))
    assert of(scaled, "D") == pytest.approx(of(PROBLEM, "D"), rel=1e-6)
