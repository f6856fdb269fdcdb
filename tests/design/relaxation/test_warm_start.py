"""A restricted master problem that starts from the answer of a like one."""

import numpy as np
import pytest
from relaxations import off_centre

import criteria
from criteria.spectral_balance import SpectralBalance
from edtk.design.problem import Problem
from edtk.design.relaxation import spectral_weights, variance_weights
from edtk.design.relaxation.master_equations import ActiveInformation
from edtk.design.relaxation.masters import own_weights
from edtk.design.relaxation.proof import WarmStart

CRITERIA = {
    "E": criteria.create("E"),
    "O2": criteria.create("O2"),
    "both": SpectralBalance(0.5, 2.0),
    "G": criteria.create("G"),
}


def test_indices_of_a_part():
    """Into a part and out of it again candidates are the same, with their weights."""
    part = np.array([3, 5, 8, 13, 21])
    start = WarmStart(np.array([21, 3, 13]), np.array([0.5, 0.3, 0.2]), np.eye(2))
    inside = start.inside(part)
    assert inside.candidates.tolist() == [4, 0, 3]
    assert inside.outside(part).candidates.tolist() == start.candidates.tolist()
    assert inside.weights is start.weights
    assert inside.multiplier is start.multiplier
    assert len(WarmStart.none()) == 0
    assert WarmStart.alike(part).weights.tolist() == [0.2] * 5


@pytest.fixture
def steps(monkeypatch):
    """Counts the steps of the interior point methods."""
    count = [0]
    for module in (spectral_weights, variance_weights):

        def counted(self, step=module._Point.step):
            count[0] += 1
            return step(self)

        monkeypatch.setattr(module._Point, "step", counted)
    return count


@pytest.mark.parametrize("name", CRITERIA)
def test_fewer_steps_to_the_same_answer(name, steps):
    """With a few new candidates the answer before them is a better start than equal weights."""
    criterion = CRITERIA[name]
    problem = Problem(off_centre(8, 70))
    problem = problem.with_unit_trace() if criterion.degree == 0 else problem
    few = ActiveInformation.of(problem, np.arange(60))
    weights, Z = own_weights(criterion, few, np.full(60, 1 / 60), 1e-4)
    every = ActiveInformation.of(problem, np.arange(70))
    steps[0] = 0
    cold, _ = own_weights(criterion, every, np.full(70, 1 / 70), 1e-8)
    from_equal = steps[0]
    warm, _ = own_weights(criterion, every, np.append(weights, np.zeros(10)), 1e-8, Z)
    assert steps[0] - from_equal < from_equal
    cost = float(criterion.cost(every.information(cold)))
    assert float(criterion.cost(every.information(warm))) == pytest.approx(cost, rel=1e-7)


@pytest.mark.parametrize("name", CRITERIA)
@pytest.mark.parametrize("kind", ["zero", "negative", "of another", "huge"])
def test_a_multiplier_that_says_nothing(name, kind):
    """Whatever the multiplier, the answer is the same."""
    criterion = CRITERIA[name]
    problem = Problem(off_centre(8, 60))
    problem = problem.with_unit_trace() if criterion.degree == 0 else problem
    active = ActiveInformation.of(problem, np.arange(60))
    equal = np.full(60, 1 / 60)
    other = np.random.default_rng(0).normal(size=(4, 4))
    near = {
        "zero": np.zeros((4, 4)),
        "negative": -np.eye(4),
        "of another": other + other.T,
        "huge": 1e9 * other @ other.T,
    }[kind]
    cold, _ = own_weights(criterion, active, equal, 1e-8)
    found, _ = own_weights(criterion, active, equal, 1e-8, near)
    cost = float(criterion.cost(active.information(cold)))
    assert float(criterion.cost(active.information(found))) == pytest.approx(cost, rel=1e-7)
