"""Options of a relaxation that make no sense."""

import pytest

from edtk.design.relaxation.restricted_master import SolverOptions


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"solvers": ("GUROBI",)},
            "unknown solver 'GUROBI'; available: NEWTON, CLARABEL, SCS, SLSQP",
        ),
        ({"solvers": ()}, "there must be a solver"),
        ({"rounds": 0}, "rounds and batch must be at least one"),
        ({"batch": 0}, "rounds and batch must be at least one"),
    ],
)
def test_rejected(options, message):
    """The message says which values are possible."""
    with pytest.raises(ValueError, match=message):
        SolverOptions(**options)
