"""A criterion whose code returns no expression, or no bound, is named in one line."""

import cvxpy as cp
import numpy as np
import pytest

import criteria
from criteria.plugins import guard_plugin
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax

PROBLEM = Problem(np.random.default_rng(0).normal(size=(20, 1, 3)))
WRONG = {
    "nothing": (lambda M: None, "returns an object of type NoneType; expected a scalar expression"),
    "a number": (lambda M: 1.0, "returns an object of type float"),
    "an array": (lambda M: np.eye(3), "returns an object of type ndarray"),
    "a constraint": (lambda M: M >> 0, "returns an object of type PSD"),
    "a pair": (lambda M: (cp.trace(M), []), "returns an object of type tuple"),
    "a vector": (cp.diag, r"has shape \(3,\); expected a scalar expression"),
}


def of_expression(expression, **methods):
    """A class of criteria with an expression of M."""

    class Mine(criteria.ConvexCriterion):
        name = "mine"
        title = "Somebody else's"
        formula = "trace(cov)"
        sense = "min"
        degree = 1.0

        def expression(self, M, T=None):
            return expression(M)

    for name, method in methods.items():
        setattr(Mine, name, method)
    return Mine


@pytest.mark.parametrize("case", WRONG)
def test_an_expression_that_is_none(case):
    """Costs and relaxations end in the same line, which names the criterion."""
    expression, message = WRONG[case]
    mine = of_expression(expression)()
    for use in (lambda: mine.cost(np.eye(3)), lambda: relax(PROBLEM, mine)):
        with pytest.raises(criteria.CriterionError, match=r"criterion 'mine': its expression") as e:
            use()
        assert e.match(message)
        assert "\n" not in str(e.value)


RETURNED = {
    "formulation": (lambda self, M, total, T, unit: total, "expected a tuple of an expression"),
    "polar": (lambda self, Z, M: None, "returns an object of type NoneType; expected a number"),
    "lower_bound": (lambda self, Z, t, M: np.ones(3), "expected a number"),
    "subproblem": (lambda self, Z, t, M: "A", "returns an object of type str; expected a criteria"),
}


@pytest.mark.parametrize("method", RETURNED)
def test_what_other_methods_of_a_plug_in_return(method):
    """A relaxation with a plug-in that returns the wrong kind of thing ends in one line."""
    function, message = RETURNED[method]
    own = {
        "smooth": False,  # others are solved without their formulation
        "_cost": lambda self, M, cov: np.trace(cov, axis1=-2, axis2=-1),
        "_gradient": lambda self, M, cov: -cov @ cov,
        "formulation": lambda self, M, total, T, unit: (cp.matrix_frac(T.T, M), [total == 1]),
    }
    cls = of_expression(lambda M: cp.matrix_frac(np.eye(3), M), **{**own, method: function})
    guard_plugin(cls)
    with pytest.raises(
        criteria.CriterionError, match=f"criterion 'mine': its {method} returns"
    ) as e:
        relax(PROBLEM, cls())
    assert e.match(message)
