"""Newton's method over the weights of a few candidates."""

import numpy as np
import pytest
from relaxations import SMOOTH, blocks_of, criterion_of, off_centre

import criteria
from criteria import ConvexCriterion
from edtk.design.problem import Problem
from edtk.design.relaxation import newton_weights as newton_module
from edtk.design.relaxation.master_equations import ActiveInformation
from edtk.design.relaxation.newton_weights import NewtonError, newton_weights, suits_newton
from edtk.design.relaxation.relax import relax

ACCURACY = 1e-9
EPS = np.finfo(float).eps
smooth = pytest.mark.parametrize("name", SMOOTH)


def active_of(rows, prior=None):
    """The information of all candidates."""
    problem = Problem(rows, prior=prior)
    return ActiveInformation.of(problem, np.arange(problem.n))


def excess(criterion, active, weights):
    """How far the largest sensitivity to minus the gradient exceeds the mean one."""
    s = active.sensitivities(-criterion.gradient(active.information(weights)))
    return s.max() / (weights @ s) - 1


def equal(k):
    """Equal weights."""
    return np.full(k, 1.0 / k)


@smooth
@pytest.mark.parametrize("with_prior", [False, True])
def test_equivalence_theorem(name, with_prior):
    """At the answer no candidate is more sensitive than the mean, to the accuracy asked for."""
    prior = np.diag([1.0, 0.0, 2.0, 0.0]) if with_prior else None
    active = active_of(off_centre(3, 50), prior)
    criterion = criterion_of(name)
    weights = newton_weights(criterion, active, equal(50), ACCURACY)
    assert (weights > 0).all()
    assert weights.sum() == pytest.approx(1, abs=64 * EPS)
    assert excess(criterion, active, weights) <= 2 * ACCURACY


@smooth
def test_start(name):
    """New candidates, which have no weight yet, get what they deserve."""
    active = active_of(blocks_of(1, 40))
    criterion = criterion_of(name)
    whole = newton_weights(criterion, active, equal(40), ACCURACY)
    start = np.where(np.arange(40) < 10, 0.1, 0.0)
    again = newton_weights(criterion, active, start, ACCURACY)
    costs = [float(criterion.cost(active.information(w))) for w in (whole, again)]
    assert costs[0] == pytest.approx(costs[1], rel=10 * ACCURACY)
    assert excess(criterion, active, again) <= 2 * ACCURACY


@pytest.mark.parametrize("name", ["A", "D", "O5"])
def test_differences_instead_of_a_closed_form(name, monkeypatch):
    """Without a closed form differences of the gradient lead to the same weights."""
    active = active_of(off_centre(3, 20))
    criterion = criterion_of(name)
    weights = newton_weights(criterion, active, equal(20), ACCURACY)
    monkeypatch.setattr(type(criterion), "curvature", lambda self, M: None)
    again = newton_weights(criterion, active, equal(20), ACCURACY)
    np.testing.assert_allclose(again, weights, atol=1e-6)


@pytest.mark.parametrize("name", ["A", "D"])
def test_rows_of_many_parameters(name):
    """With more parameters than whole matrices are kept for, the gap is closed all the same."""
    problem = Problem(np.random.default_rng(0).normal(size=(400, 2, 15)))
    found = relax(problem, criteria.create(name))
    assert found.solver == "NEWTON"
    assert found.gap >= -1e-12
    assert found.gap <= 1e-6


class Inhomogeneous(ConvexCriterion):
    """A criterion that is not homogeneous, although it says so."""

    name = "inhomogeneous"
    title = "Inhomogeneous"
    formula = "trace(cov) + 1"
    sense = "min"
    degree = 1.0

    def _cost(self, M, cov):
        return np.trace(cov, axis1=-2, axis2=-1) + 1

    def _gradient(self, M, cov):
        return -cov @ cov


def test_false_degree():
    """A criterion that breaks its homogeneity is found out before a step is taken."""
    with pytest.raises(NewtonError, match="inhomogeneous is not homogeneous of degree 1"):
        newton_weights(Inhomogeneous(), active_of(blocks_of(0)), equal(60), ACCURACY)


def test_open_direction():
    """Weights that leave a direction open are no start."""
    rows = blocks_of(0)
    rows[:, :, 1] = 0.0
    with pytest.raises(NewtonError, match="leave a direction open"):
        newton_weights(criterion_of("D"), active_of(rows), equal(60), ACCURACY)


@pytest.mark.slow
def test_suits():
    """Smooth criteria suit the method; without a closed form only of few parameters."""
    assert all(suits_newton(criterion_of(name), 4) for name in SMOOTH)
    assert not any(suits_newton(criterion_of(name), 4) for name in ("E", "G", "O2", "O4"))
    assert suits_newton(Inhomogeneous(), 40)
    assert not suits_newton(Inhomogeneous(), 41)
    assert suits_newton(criteria.create("A"), 1000)


def test_goes_on_from_an_answer(monkeypatch):
    """Programs with new candidates start inside: a polynomial under A took 40 steps in all before.

    Neighbours of its points got weights so large that the first steps had to be short.
    """
    steps = []
    step = newton_module._Point.step
    monkeypatch.setattr(newton_module._Point, "step", lambda self: steps.append(0) or step(self))
    x = np.linspace(-1, 1, 2001)
    found = relax(Problem(np.vander(x, 6, increasing=True)[:, None, :]), criteria.create("A"))
    assert found.gap <= 1e-6
    assert 0 < len(steps) < 40
