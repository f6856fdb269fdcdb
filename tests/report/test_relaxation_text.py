"""The text of a relaxation tells whose word its bound is, and how many digits it has."""

import numpy as np
import pytest
from no_dual import NoDual

import criteria
import edtk
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax
from edtk.report.views.problem import problem_plan_text
from edtk.report.views.relaxation import relaxation_text


@pytest.mark.slow
def test_bound_by_a_solvers_word():
    """The line of the bound says so instead of "proved"."""
    x = np.linspace(-1, 1, 5)
    problem = Problem(np.stack([np.ones(5), x], axis=-1)[:, None, :])
    assert "(by a solver's word, relative gap" in relaxation_text(relax(problem, NoDual()))
    assert "(proved, relative gap" in relaxation_text(relax(problem, criteria.create("A")))


def test_plan_under_a_bound_by_a_solvers_word():
    """So does the line of a plan of whole experiments."""
    x = np.linspace(-1, 1, 5)
    problem = Problem(np.stack([np.ones(5), x], axis=-1)[:, None, :])
    plan = edtk.plan(problem, size=3, criterion=NoDual(), seed=1, starts=2)
    assert "(by a solver's word, of weights)" in problem_plan_text(plan)
    plan = edtk.plan(problem, size=3, criterion="A", seed=1, starts=2)
    assert "(proved, of weights)" in problem_plan_text(plan)


def test_digits_of_an_ill_conditioned_model():
    """A line tells by how much rounding may change the numbers, and the remedy."""
    rows = np.vander(np.linspace(10, 11, 41), 7, increasing=True)
    found = relaxation_text(relax(Problem(rows[:, None, :]), criteria.create("D")))
    assert "ill-conditioned: rounding may change these numbers by" in found
    assert "centre or scale" in found
