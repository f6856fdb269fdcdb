"""Cost and gradient of exact plans."""

from dataclasses import replace

import numpy as np
import pytest
from designs import KR270 as DESIGN
from designs import STUDY

import criteria
from edtk.design import Plan, sample_feasible


def plan_of(k=5, seed=0):
    q, rng = sample_feasible(DESIGN, k, seed), np.random.default_rng(seed)
    return Plan(q, DESIGN.wrench + rng.normal(scale=100, size=(k, 6)), np.arange(1, k + 1))


@pytest.mark.parametrize("name", criteria.available())
@pytest.mark.parametrize("seed", range(2))
def test_gradient(name, seed, derivative):
    """The gradient of the log cost is its finite difference, where the extreme eigenvalues are simple.

    Poses of a random plan have eigenvalues well apart; wrenches and repetitions differ from row to row.
    """
    plan, criterion = plan_of(seed=seed), STUDY.criterion(name)
    spectrum = np.linalg.eigvalsh(DESIGN.information(plan))
    assert (np.diff(np.log(spectrum)) > 0.05).all()

    def f(x):
        return np.asarray(DESIGN.cost_and_gradient(criterion, replace(plan, q=x.reshape(plan.q.shape)))[0])

    value, gradient = DESIGN.cost_and_gradient(criterion, plan)
    assert value == pytest.approx(np.log(float(criterion.cost(DESIGN.information(plan)))), rel=1e-12)
    expected = derivative(f, plan.q.ravel(), h=2e-4).reshape(plan.q.shape)
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-7 * np.abs(gradient).max())


def test_information_of_repetitions():
    """A pose with repetitions tells what as many rows of it tell, and a plan what its poses tell together."""
    plan = plan_of()
    rows = np.repeat(np.arange(5), plan.repeats)
    spread = Plan(plan.q[rows], plan.wrench[rows], np.ones(len(rows), dtype=int))
    np.testing.assert_allclose(DESIGN.information(spread), DESIGN.information(plan), rtol=1e-11)
    np.testing.assert_allclose(DESIGN.information(plan.repeated(3)), 3 * DESIGN.information(plan), rtol=1e-12)


def test_base_joint_does_not_matter():
    """A vertical load leaves the plan's worth alone when the whole arm turns about the vertical joint 1."""
    plan = replace(plan_of(), wrench=np.tile(DESIGN.wrench, (5, 1)))
    gradient = DESIGN.cost_and_gradient(STUDY.criterion("rho0"), plan)[1]
    np.testing.assert_allclose(gradient[:, 0], 0, atol=1e-10 * np.abs(gradient).max())


def test_singular_plan():
    """A plan that cannot identify all parameters has infinite log cost and no slope."""
    value, gradient = DESIGN.cost_and_gradient(STUDY.criterion("D"), plan_of(k=1))
    assert value == np.inf
    assert not gradient.any()


def test_plan_has_the_common_wrench():
    """Poses become a plan under the design's wrench."""
    q = plan_of().q
    plan = DESIGN.plan(q, np.ones(5, dtype=int))
    np.testing.assert_array_equal(plan.wrench, np.tile(DESIGN.wrench, (5, 1)))
    M = DESIGN.problem(q).information(np.ones(5))
    np.testing.assert_allclose(DESIGN.information(plan), M, rtol=1e-12)
