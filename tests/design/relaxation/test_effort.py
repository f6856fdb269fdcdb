"""How much is spent on the next program, and by which solvers."""

from types import SimpleNamespace

import numpy as np
import pytest

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.restricted_master import (
    FINEST,
    Effort,
    RelaxationError,
    RestrictedMaster,
)

CHAIN = ("NEWTON", "CLARABEL", "SCS")


def test_a_proved_gap_is_sharpened_by_newton_alone():
    """A last program for more digits is not worth a program of cvxpy's."""
    step = SimpleNamespace(solver="NEWTON")
    proved = Effort(CHAIN, 0.05).after(step, True, 1e-8, 3, is_proved=True)
    assert proved == Effort(("NEWTON",), FINEST)
    assert Effort(CHAIN, 0.05).after(step, True, 1e-3, 3) == Effort(CHAIN, FINEST)
    assert Effort(("NEWTON",), FINEST).after(step, True, 1e-8, 3, is_proved=True).solvers == ()


def test_a_program_that_does_not_fit_into_memory_has_failed(monkeypatch):
    """The next solver is tried, as after any other failure."""

    def does_not_fit(self, blocks, solver, loose):
        raise MemoryError("Unable to allocate 50 GiB")

    monkeypatch.setattr(RestrictedMaster, "_solve", does_not_fit)
    blocks = Problem(np.random.default_rng(0).normal(size=(9, 1, 2))).blocks(np.arange(9))
    program = RestrictedMaster(criteria.create("D"), blocks.mean(axis=0), 9)
    with pytest.raises(RelaxationError, match="CLARABEL: Unable to allocate 50 GiB"):
        program.solve(blocks, "CLARABEL")
