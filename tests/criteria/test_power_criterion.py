"""Powers of criteria: O1 is the root of D, O3 the root of E, in everything that they compute."""

import numpy as np
import pytest
from matrices import candidates, make, optimum, positive, sensitivities, slip

import criteria
from criteria import PowerCriterion

POWERS = {"O1": "D", "O3": "E"}
OTHERS = ("A", "D", "E", "G", "O2", "O4", "O5", "rho0", "rho_max")

powers = pytest.mark.parametrize(("name", "base"), POWERS.items())


@powers
def test_a_power_computes_the_power_of_its_base(name, base):
    """Cost, value, polar and bound are those of the base, to the exponent."""
    rng = np.random.default_rng(0)
    c = make(name, 4)
    other = make(base, 4)
    for _ in range(5):
        M = positive(rng, 4, 1e3)
        Z = np.stack([positive(rng, 4), positive(rng, 4)])
        t = rng.uniform(1, 2, size=2)
        accuracy = slip(M)
        assert c.cost(M) == pytest.approx(np.sqrt(other.cost(M)), rel=accuracy)
        assert c.value(M) == pytest.approx(np.sqrt(other.value(M)), rel=accuracy)
        assert c.polar(Z[0], M) == pytest.approx(np.sqrt(other.polar(Z[0], M)), rel=accuracy)
        bound = np.sqrt(other.lower_bound(Z, t, M))
        assert c.lower_bound(Z, t, M) == pytest.approx(bound, rel=accuracy)


@powers
def test_what_a_power_declares_follows_from_its_base(name, base):
    """Degree and power of the expression are the base's, times or over the exponent."""
    cls = criteria.get(name)
    other = criteria.get(base)
    assert issubclass(cls, PowerCriterion)
    assert cls.base_class is other
    assert cls.degree == cls.exponent * other.degree
    assert cls.expression_power == other.expression_power / cls.exponent
    for declared in ("sense", "convex", "smooth", "monotone", "unit_free", "most_subproblems"):
        assert getattr(cls, declared) == getattr(other, declared)


@powers
def test_a_power_has_the_plans_of_its_base(name, base):
    """The base's optimum over candidates is the power's, and its bound is turned into the power's.

    So a search for the base answers for both.
    """
    rng = np.random.default_rng(1)
    blocks = candidates(rng, 12, 4)
    c = make(name, 4)
    assert c.plan_criterion.name == base
    M, Z = optimum(c.plan_criterion, blocks)
    t = sensitivities(Z[None], blocks)
    proved = c.cost_from_plan_criterion(c.plan_criterion.lower_bound(Z[None], t, M))
    assert proved == pytest.approx(c.lower_bound(Z[None], t, M), rel=1e-14)
    found = c.cost_from_plan_criterion(float(c.plan_criterion.cost(M)))
    assert found == pytest.approx(c.cost(M), rel=slip(M))
    assert -slip(M) <= 1 - proved / found <= 1e-6


@pytest.mark.parametrize("name", OTHERS)
def test_other_criteria_are_searched_themselves(name):
    """A criterion that is no power is its own plan criterion, and costs stay as they are."""
    c = make(name, 3)
    assert c.plan_criterion is c
    assert c.cost_from_plan_criterion(0.3) == 0.3


def test_a_power_of_a_power():
    """Powers nest: the plan criterion is the innermost base."""

    class FourthRoot(PowerCriterion):
        name = "fourth root"
        title = "Fourth root of D"
        formula = "det(M)^(1/4p)"
        sense = "max"
        degree = 0.25
        base_class = criteria.get("O1")
        exponent = 0.5
        expression_power = 4.0

    M = positive(np.random.default_rng(2), 3)
    c = FourthRoot()
    assert c.plan_criterion.name == "D"
    cost = float(make("D", 3).cost(M))
    assert c.cost_from_plan_criterion(cost) == pytest.approx(cost**0.25, rel=1e-14)
    assert c.cost(M) == pytest.approx(cost**0.25, rel=1e-14)


@pytest.mark.parametrize("p", [1, 3, 6])
def test_determinant_alone_gives_the_cost(p):
    """D and O1 are the same from the logarithm of the determinant as from the matrix."""
    M = positive(np.random.default_rng(p), p)
    log_det = np.linalg.slogdet(M).logabsdet
    for name in ("D", "O1"):
        c = make(name, p)
        assert c.cost_of_log_determinant(log_det, p) == pytest.approx(c.cost(M), rel=1e-15)
