"""Costs of designs that all but leave open what they are asked for."""

import numpy as np
import pytest

import criteria
from edtk.design.relaxation.proof import safe_cost

# Of a cubic on [-1, 1] the combination k2 + 0.3 k4 is best told by two points, +-0.3^(1/2), with
# the cost 10/3: there Elfving's vector (0, 1, 0, 0.3) is (0.3)^-1/2 (f(x) - f(-x))/2.
SLOPE = np.array([0.0, 1.0, 0.0, 0.3])
LEAST = 10 / 3
CRITERIA = {
    "c": criteria.create("c", c=SLOPE),
    "I": criteria.create("I", W=np.outer(SLOPE, SLOPE)),
    "A of it": criteria.create("A", interest=SLOPE),
}


def design(points, weights):
    """The information (4, 4) of weights on points."""
    rows = np.vander(points, 4, increasing=True)
    return rows.T @ (np.array(weights)[:, None] * rows)


# Found by a search: two points close to the best ones, and a hint of a third.
LURE = design(
    [-0.54772532, 0.547726, -0.06051762], [0.499999876579, 0.500000122504, 9.16177623e-10]
)


@pytest.mark.parametrize("name", CRITERIA)
def test_a_design_that_does_not_tell_it(name):
    """Its own cost is below that of every design; the safe one is not."""
    criterion = CRITERIA[name]
    assert criterion.cost(LURE) < LEAST * (1 - 1e-5)
    assert LEAST <= safe_cost(criterion, LURE) < LEAST * (1 + 1e-4)
    assert criterion.strayed(LURE) > 1e-6


@pytest.mark.parametrize("name", CRITERIA)
def test_a_singular_design_that_tells_it(name):
    """The best design has its own cost, to the last digits."""
    M = design(np.sqrt(0.3) * np.array([-1.0, 1.0]), [0.5, 0.5])
    assert safe_cost(CRITERIA[name], M) == pytest.approx(LEAST, rel=1e-12)


@pytest.mark.slow
def test_no_design_near_the_best_is_below_it():
    """Whatever the distance from the best points, and the weight that keeps a third one."""
    rng = np.random.default_rng(0)
    below = 0
    for _ in range(600):
        away = 10.0 ** rng.uniform(-6, -4)
        light = 10.0 ** rng.uniform(-12, -6)
        ends = np.sqrt(0.3) * np.array([-1.0, 1.0]) + away * rng.normal(size=2)
        share = 0.5 + away * rng.normal()
        M = design(
            [*ends, rng.uniform(-1, 1)], [share * (1 - light), (1 - share) * (1 - light), light]
        )
        below += CRITERIA["c"].cost(M) < LEAST * (1 - 1e-7)
        assert safe_cost(CRITERIA["c"], M) >= LEAST * (1 - 1e-9)
    assert below > 0


def test_criteria_of_all_parameters_have_nothing_to_stray():
    """They cost inf where a direction is open."""
    assert criteria.create("D").strayed(LURE) == 0
    assert safe_cost(criteria.create("D"), np.diag([1.0, 2.0, 0.0])) == np.inf
