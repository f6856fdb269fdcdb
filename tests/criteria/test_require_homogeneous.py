"""A criterion that breaks its declared homogeneity is found out."""

import numpy as np
import pytest

import criteria
from criteria.errors import CriterionError
from criteria.plugins import require_homogeneous

M = np.diag([1.0, 2.0, 5.0])


class Variances(criteria.Criterion):
    """The sum of the variances to a power, with a degree that may be wrong."""

    name = "sum of variances"
    title = "Sum"
    formula = "trace(cov)^power"
    sense = "min"
    degree = 1.0

    def __init__(self, power=1.0, shift=0.0, sign=1.0):
        self.power = power
        self.shift = shift
        self.sign = sign

    def _cost(self, M, cov):
        return self.sign * np.trace(cov, axis1=-2, axis2=-1) ** self.power + self.shift

    def _gradient(self, M, cov):
        return -cov @ cov


@pytest.mark.parametrize("name", criteria.available())
def test_builtins_keep_their_promise(name):
    """All built-in criteria pass, in good units and in bad ones."""
    criterion = criteria.create(name, target=np.eye(3))
    for units in ([1, 1, 1], [1e-7, 1.0, 1e5]):
        require_homogeneous(criterion, M * np.outer(units, units))


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (Variances(power=0.5), "not homogeneous of degree 1: 0.25 times the information has 2 "),
        (Variances(shift=1e-3), "not homogeneous of degree 1"),
        (Variances(sign=-1.0), "expected a positive number"),
    ],
    ids=["power", "shift", "sign"],
)
def test_broken_promises(broken, words):
    """A wrong degree, a constant and a negative cost are told in one line with numbers."""
    with pytest.raises(CriterionError, match=words):
        require_homogeneous(broken, M)


def test_plugin_is_asked_when_it_is_made(monkeypatch):
    """A registered class of a third party is found out by `create`, before anybody uses it."""
    monkeypatch.setattr("criteria.registry._registered", {})
    monkeypatch.setattr(Variances, "degree", 2.0)
    criteria.register(Variances)
    with pytest.raises(CriterionError, match="not homogeneous of degree 2"):
        criteria.create("sum of variances")
    monkeypatch.setattr(Variances, "degree", 1.0)
    assert criteria.create("sum of variances").degree == 1.0


def test_where_the_cost_is_infinite_nothing_is_checked():
    """A singular matrix tells nothing about homogeneity."""
    require_homogeneous(Variances(shift=1.0), np.diag([1.0, 0.0, 1.0]))
