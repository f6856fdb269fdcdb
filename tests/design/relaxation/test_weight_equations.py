"""The equations of a Newton step, against a dense solution."""

import numpy as np
import pytest

from edtk.design.relaxation.master_equations import weight_equations


@pytest.mark.parametrize("k", [3, 10, 11, 40])
@pytest.mark.parametrize("takes_away", [False, True])
def test_solution(k, takes_away):
    """Few candidates or many, the solution is that of the whole matrix."""
    rng = np.random.default_rng(k)
    P = rng.normal(size=(10, k))
    D = rng.uniform(0.5, 2.0, size=k)
    lost = 0.3 * P.T @ rng.dirichlet(np.ones(10)) if takes_away else None
    whole = P.T @ P + np.diag(D)
    if lost is not None:
        whole -= np.outer(lost, lost)
    solve = weight_equations(P, D, lost)
    for b in rng.normal(size=(3, k)):
        np.testing.assert_allclose(solve(b), np.linalg.solve(whole, b), rtol=1e-9, atol=1e-12)


def test_candidates_that_tell_the_same():
    """Equal candidates of no slack make the matrix singular; the step is still one that solves."""
    rng = np.random.default_rng(0)
    P = np.repeat(rng.normal(size=(10, 4)), 2, axis=1)
    x = weight_equations(P, np.full(8, 1e-30))(P.T @ P @ np.ones(8))
    np.testing.assert_allclose(P @ x, P @ np.ones(8), rtol=1e-6)


def test_more_is_taken_away_than_there_is():
    """A square that leaves nothing definite is not taken away."""
    P = np.eye(3)
    D = np.full(3, 1e-3)
    lost = 2.0 * np.eye(3)[0]
    np.testing.assert_allclose(
        weight_equations(P, D, lost)(np.ones(3)), weight_equations(P, D)(np.ones(3))
    )


def test_many_candidates_without_slack():
    """Many candidates of no slack, as at the optimum, still leave equations that can be solved."""
    rng = np.random.default_rng(0)
    P = rng.normal(size=(4, 30))
    D = np.full(30, 1e-18)
    x = weight_equations(P, D)(P.T @ P @ np.ones(30))
    np.testing.assert_allclose(P @ x, P @ np.ones(30), rtol=1e-2)
