"""Shares of coordinates outside their bands: closed forms, and Monte Carlo of what varies."""

import numpy as np
import pytest
from scipy.stats import binom

from edtk.fit.least_squares import LeftOut, chance_of_outside, independent_coordinates

BOUND = 1.959963985


def test_independent_coordinates_are_counted() -> None:
    """Each counts once, whatever its size; those that are all alike count as one; none unseen."""
    m, r = 8, 6
    sizes = np.random.default_rng(0).uniform(0.1, 9, (m, r))
    diagonal = np.einsum("mr,rs->mrs", sizes, np.eye(r))
    seen = np.ones((m, r), dtype=bool)
    assert independent_coordinates(diagonal, seen, False) == pytest.approx(m * r)
    alike = np.einsum("mr,ms->mrs", sizes, sizes)
    assert independent_coordinates(alike, seen, False) == pytest.approx(m)
    seen[:, 3:] = False
    assert independent_coordinates(diagonal, seen, False) == pytest.approx(3 * m)
    assert independent_coordinates(alike, seen, False) == pytest.approx(m)
    assert independent_coordinates(alike, np.zeros((m, r), dtype=bool), False) == 0


def test_the_tail_is_the_binomial_one() -> None:
    """With whole numbers; a share that is not too large is no surprise."""
    for count, number in ((14, 100), (3, 12), (40, 500)):
        expected = binom.sf(count - 1, number, 0.05)
        assert chance_of_outside(count / number, number) == pytest.approx(expected, rel=1e-9)
    assert chance_of_outside(0.05, 100) == chance_of_outside(0.0, 100) == 1
    assert chance_of_outside(0.5, 0.0) == 1


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("scaled", [False, True])
def test_shares_vary_no_more_than_so_many_independent_ones(
    correlation: float, scaled: bool
) -> None:
    """Shares of simulated days: as a binomial share, or a little less where the rest is bounded."""
    rng = np.random.default_rng(1)
    m, r, days = 30, 6, 3000
    C = (1 - correlation) * np.eye(r) + correlation
    z = rng.standard_normal((days, m, r)) @ np.linalg.cholesky(C).T
    if scaled:
        z /= np.sqrt((z**2).mean(axis=(1, 2), keepdims=True))
    spread = (np.abs(z) > BOUND).mean(axis=(1, 2)).std()
    every = np.ones((m, r), dtype=bool)
    number = independent_coordinates(np.tile(C, (m, 1, 1)), every, scaled)
    said = np.sqrt(0.05 * 0.95 / number)
    assert 0.7 * said < spread < 1.04 * said


def test_errors_of_few_groups_hang_together() -> None:
    """What groups are off in the fits without them has the covariance of ``(I - H_b)^-1 z_b``."""
    groups, rows, p = 4, 3, 5
    group = np.repeat(np.arange(groups), rows)
    Q = np.linalg.qr(np.random.default_rng(1).normal(size=(groups * rows, p)))[0]
    each = Q.reshape(groups, rows, p)
    G = np.swapaxes(each, 1, 2) @ each
    out = LeftOut.of(G, np.zeros((groups, p)), G)
    H = Q @ Q.T
    same = group[:, None] == group
    away = np.linalg.inv(np.eye(len(Q)) - np.where(same, H, 0.0))
    expected = away @ (np.eye(len(Q)) - H) @ away
    found = out.between(Q, group)
    np.testing.assert_allclose(found[~same], expected[~same], atol=1e-12)
    # There are no more of them than residuals of the fit of all.
    assert np.linalg.matrix_rank(expected, tol=1e-9) == groups * rows - p
