"""Refinement of poses under constraints."""

import numpy as np
import pytest
from designs import KR270 as DESIGN
from designs import STUDY

from edtk.design import Plan, refine, sample_feasible


def start_of(k, seed):
    q = sample_feasible(DESIGN, k, seed)
    return Plan(q, np.tile(DESIGN.wrench, (k, 1)), 1 + np.arange(k) % 2)


def cost(criterion, plan):
    return float(criterion.cost(DESIGN.information(plan)))


@pytest.mark.parametrize("name", ["rho0", "D", "E"])
@pytest.mark.parametrize("iterations", [1, 25])
def test_never_worse_and_feasible(name, iterations):
    """From a feasible start comes a plan that is no worse and feasible; repetitions and fixed joints are kept."""
    criterion = STUDY.criterion(name)
    for seed in range(2):
        start = start_of(3, seed)
        plan = refine(DESIGN, criterion, start, iterations=iterations)
        assert cost(criterion, plan) <= cost(criterion, start)
        assert DESIGN.workspace.contains(plan.q).all()
        np.testing.assert_array_equal(plan.repeats, start.repeats)
        np.testing.assert_array_equal(plan.wrench, start.wrench)
        np.testing.assert_array_equal(plan.q[:, 0], start.q[:, 0])


def test_start_is_not_changed():
    """The start's arrays are left alone."""
    start = start_of(3, 0)
    q = start.q.copy()
    refine(DESIGN, STUDY.criterion("D"), start, iterations=5)
    np.testing.assert_array_equal(start.q, q)


def test_singular_start_comes_back():
    """One pose cannot identify five parameters: the start is returned, without an error."""
    start = start_of(1, 0)
    np.testing.assert_array_equal(refine(DESIGN, STUDY.criterion("D"), start).q, start.q)


def test_infeasible_start_becomes_feasible():
    """A start outside the workspace is never better than the feasible plan that comes back."""
    start = start_of(3, 0)
    start.q[0, 2] += 0.6
    assert not DESIGN.workspace.contains(start.q).all()
    assert DESIGN.workspace.contains(refine(DESIGN, STUDY.criterion("D"), start).q).all()


def test_smooth_optimum_is_stationary():
    """Without active constraints a refined D plan has no slope left along any free joint."""
    criterion = STUDY.criterion("D")
    plan = refine(DESIGN, criterion, start_of(3, 1), iterations=300)
    gradient = DESIGN.cost_and_gradient(criterion, plan)[1][:, DESIGN.free]
    slack = DESIGN.workspace.slack(plan.q)
    G = DESIGN.workspace.gradient(plan.q)[..., DESIGN.free]
    for g, s, rows in zip(gradient, slack, G, strict=True):
        active = rows[s < 1e-6]
        rest = g - active.T @ np.linalg.lstsq(active.T, g, rcond=None)[0] if len(active) else g
        assert np.abs(rest).max() < 1e-3


def test_published_plan_of_four_is_improved():
    """Four experiments: a refined random plan beats the published one of Table 4 by more than 5 % in rho0."""
    criterion = STUDY.criterion("rho0")
    published = STUDY.published_plans()["table_4_4"]
    start = DESIGN.plan(sample_feasible(DESIGN, 4, 0), np.ones(4, dtype=int))
    plan = refine(DESIGN, criterion, start)
    assert DESIGN.workspace.contains(plan.q).all()
    assert plan.experiments == published.experiments
    assert cost(criterion, plan) < 0.95 * cost(criterion, published)
