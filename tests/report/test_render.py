"""A result is rendered by the file of its class, or of a base class."""

import numpy as np
import pytest

from edtk.calibration.posterior_check import PoseError
from edtk.design.plan import Plan
from edtk.report.render import render


class Derived(PoseError):
    """A class that edtk.report knows nothing of."""


def test_a_base_class_lends_its_file() -> None:
    """The nearest base class with a file renders the result."""
    numbers = dict.fromkeys(("rho0", "rho0_error", "rho0_fit", "error_95"), 1e-6)
    given = {"displacement": np.zeros(3), "displacement_95": np.zeros((2, 3))}
    result = Derived(**numbers, **given)
    assert render("text", result) == PoseError(**numbers, **given).summary()
    assert result.summary().startswith("test pose: rho0 0.001000 +- 0.001000 mm")


def test_what_is_no_result_is_refused() -> None:
    """A number has no rendering."""
    with pytest.raises(TypeError, match="int is no result"):
        render("text", 3)


def test_a_table_takes_no_further_arguments() -> None:
    """Text and notebook of a result that is a table refuse what they would not look at."""
    plan = Plan(np.zeros((1, 6)), np.zeros((1, 6)), np.ones(1, dtype=int))
    assert render("text", plan) == plan.summary()
    for arguments, options in (((1,), {}), ((), {"digits": 3})):
        with pytest.raises(TypeError, match="the text of a Plan takes no arguments or options"):
            render("text", plan, *arguments, **options)
