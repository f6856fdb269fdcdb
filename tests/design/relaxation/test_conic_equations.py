"""The equations of a step of the method for semidefinite programs, against a dense solution."""

import numpy as np
import pytest

from edtk.design.relaxation.master_equations import conic_equations


@pytest.mark.parametrize("k", [4, 30])
@pytest.mark.parametrize("smallest", [1.0, 1e-12])
@pytest.mark.parametrize("has_last", [False, True])
def test_equations_hold(k, smallest, has_last):
    """Few weights or many, with slacks that vanish or not, all three equations hold."""
    rng = np.random.default_rng(k)
    q = 10
    P = rng.normal(size=(q, k))
    D = rng.uniform(0.5, 2.0, size=k)
    D[:3] *= smallest
    last = rng.normal(size=q) if has_last else None
    solve = conic_equations(P, D, last)
    for _ in range(3):
        c = rng.normal(size=q)
        d = rng.normal(size=k)
        u = float(rng.normal()) if has_last else 0.0
        x, z, y = solve(c, d, u)
        size = np.abs(x).max() + abs(z)
        total = y + P @ x
        if last is not None:
            total = total + z * last
            assert last @ y == pytest.approx(u, abs=1e-9 * max(1.0, size * smallest))
        np.testing.assert_allclose(total, c, atol=1e-9 * max(1.0, size * smallest))
        np.testing.assert_allclose(D * x - P.T @ y, d, atol=1e-9 * max(1.0, size * smallest))
