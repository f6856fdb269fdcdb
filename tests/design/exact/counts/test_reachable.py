"""Largest sums within limits against linear programs."""

import numpy as np
import pytest
from scipy.optimize import linprog

from edtk.design.exact.counts.limits import Limits, Reachable

RNG = np.random.default_rng(8)
N = 9
BASE = np.zeros((2, 2))


@pytest.mark.parametrize("case", ["size", "most", "funds", "funds and most", "both", "all"])
def test_largest_sum_is_that_of_the_linear_program(case):
    """With every kind of limit the sum is the program's, and the counts obey the limits."""
    for _ in range(10):
        costs = RNG.uniform(0.5, 3.0, N) if case not in ("size", "most") else None
        most = RNG.integers(1, 4, N) if "most" in case or case == "all" else None
        sized = "funds" not in case
        limits = Limits(7, BASE, most, costs, 9.0, sized)
        gains = RNG.normal(size=N) + 1.0
        total, counts = Reachable(limits, N).largest(gains)
        program = linprog(
            -gains,
            A_ub=None if costs is None else costs[None],
            b_ub=None if costs is None else [9.0],
            A_eq=np.ones((1, N)) if sized else None,
            b_eq=[7.0] if sized else None,
            bounds=[(0, None if most is None else most[i]) for i in range(N)],
        )
        if program.status == 2:
            continue
        assert total == pytest.approx(-program.fun, rel=1e-8)
        assert counts @ gains == pytest.approx(total, rel=1e-6)
        assert (counts >= 0).all()
        assert most is None or (counts <= most + 1e-9).all()
        assert costs is None or counts @ costs <= 9.0 * (1 + 1e-9)
