"""A bound scales, prints and compares itself."""

import math

import numpy as np
import pytest

import criteria
from criteria import create
from edtk.design.bound import Bound, BoundKind, printed_form

NAMES = ["A", "D", "E", "O1", "O2", "O4"]  # degrees 1, 1, 1, 1/2, 0 and 1/2; both senses
MATRIX = np.array([[4.0, 1.0], [1.0, 2.0]])


def bound_of(name, kind=BoundKind.SEARCHED):
    """A bound four fifths of the cost of one matrix."""
    criterion = create(name)
    cost = float(criterion.cost(MATRIX))
    return Bound.of(criterion, 0.8 * cost, cost, kind)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("m", [1, 4, 12])
def test_scaled(name, m):
    """For m experiments the bound keeps its ratio to the scaled cost, its kind and its gap."""
    bound = bound_of(name).scaled(m)
    cost = float(create(name).cost(m * MATRIX))
    assert bound.efficiency(cost) == pytest.approx(0.8, rel=1e-12)
    assert bound.gap_to(cost) == pytest.approx(0.2, rel=1e-12)
    assert bound.gap == bound_of(name).gap == pytest.approx(0.2, rel=1e-12)
    assert bound.kind is BoundKind.SEARCHED


@pytest.mark.parametrize("name", NAMES)
def test_value(name):
    """The printed bound is on the better side of the printed value, by the ratio of the costs."""
    criterion = create(name)
    ratio = bound_of(name).value / float(criterion.value(MATRIX))
    assert ratio == pytest.approx(0.8 if criterion.sense == "min" else 1 / 0.8, rel=1e-12)


def test_a_bound_that_says_nothing():
    """A cost of zero prints as zero where less is better, and as infinity where more is."""
    for name, printed in (("A", 0.0), ("D", math.inf)):
        criterion = create(name)
        bound = Bound.of(criterion, 0.0, 2.0, BoundKind.PROVED)
        assert bound.value == (0.0 if criterion.sense == "min" else printed)
        assert (bound.gap, bound.efficiency(2.0)) == (1.0, 0.0)


@pytest.mark.parametrize("name", criteria.available())
def test_printed_form(name):
    """Costs become the values of the formula, and values costs, one by one and as arrays."""
    criterion = criteria.get(name)
    costs = np.array([0.25, 2.0, 1e-9])
    values = printed_form(costs, criterion.sense)
    np.testing.assert_array_equal(values, costs if criterion.sense == "min" else 1 / costs)
    np.testing.assert_allclose(printed_form(values, criterion.sense), costs, rtol=1e-15)
    for cost, value in zip(costs, values, strict=True):
        assert printed_form(float(cost), criterion.sense) == value


def test_printed_form_of_zero():
    """The reciprocal of a cost of zero is infinite, without a warning."""
    assert printed_form(0.0, "max") == math.inf
    np.testing.assert_array_equal(printed_form(np.array([0.0, 2.0]), "max"), [math.inf, 0.5])


def test_kinds_in_words():
    """The kinds of a bound are four, each in the words that a person reads."""
    words = [kind.value for kind in BoundKind]
    assert words == [
        "proved on candidates",
        "on candidates, by a solver's word",
        "searched",
        "proved on the continuum",
    ]
