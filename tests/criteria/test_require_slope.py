"""A gradient that is not that of the cost is found out."""

import numpy as np
import pytest

import criteria
from criteria.errors import CriterionError
from criteria.plugins import require_slope

M = np.diag([1.0, 2.0, 5.0]) + 0.5


class Variances(criteria.Criterion):
    """The sum of the variances, with a gradient that is wrong by a power or a factor."""

    name = "sum of variances"
    title = "Sum"
    formula = "trace(cov)"
    sense = "min"
    degree = 1.0

    def __init__(self, factor=-1.0, power=2):
        self.factor = factor
        self.power = power

    def _cost(self, M, cov):
        return np.trace(cov, axis1=-2, axis2=-1)

    def _gradient(self, M, cov):
        return self.factor * np.linalg.matrix_power(cov, self.power)


@pytest.mark.parametrize("name", criteria.available())
def test_builtins_have_their_slope(name):
    """All built-in criteria pass, and so does a gradient that is right."""
    require_slope(criteria.create(name, target=np.eye(3)), M)
    require_slope(Variances(), M)


@pytest.mark.parametrize("wrong", [(1.0, 2), (-1.0, 1), (-1.02, 2)], ids=["sign", "power", "2 %"])
def test_a_wrong_gradient_is_told_with_numbers(wrong):
    """A sign, a power and a factor that is a little off are told in one line."""
    with pytest.raises(CriterionError, match="its gradient is not that of its cost") as error:
        require_slope(Variances(*wrong), M)
    assert "\n" not in str(error.value)


def test_a_subgradient_at_a_kink_is_right():
    """Where the largest variances are equal the gradient of either one will do."""
    require_slope(criteria.create("G"), np.eye(3))
    require_slope(criteria.create("E"), np.eye(3))


def test_a_plugin_is_asked_when_it_is_made(monkeypatch):
    """A registered class of a third party is found out by `create`, before anybody uses it."""
    monkeypatch.setattr("criteria.registry._registered", {})
    monkeypatch.setattr(Variances.__init__, "__defaults__", (1.0, 2))
    criteria.register(Variances)
    with pytest.raises(CriterionError, match="its gradient is not"):
        criteria.create("sum of variances")
