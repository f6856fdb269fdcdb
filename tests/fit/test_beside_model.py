"""Readings that stand out beyond the errors of a model: deletion, written out with matrices."""

import numpy as np
import pytest
from scipy.stats import chi2

from edtk.fit.beside_model import BesideModel, rows_beyond_model
from edtk.fit.correlated_noise import CorrelatedNoise
from edtk.fit.missing import SIZES, MissingColumns
from edtk.measure.missing_pieces import PieceColumns

SIGMA = 0.5
TURN = 0.32  # a size of the scale


def given(seed, poses=12, repeats=2, off=(), size=0.0, correlated=False):
    """Readings of random springs whose turns are others in each pose; some are off by a size."""
    rng = np.random.default_rng(seed)
    m = poses * repeats
    pose = np.repeat(np.arange(poses), repeats)
    A = rng.standard_normal((poses, 3, 2))[pose]
    turns = 10 * rng.standard_normal((poses, 3, 4))[pose]
    shared = rng.standard_normal((poses, 3, 3))[pose]
    known = 0.3 * rng.standard_normal((poses, 3, 1))[pose]
    drawn = TURN * rng.standard_normal((poses, 4))[pose]
    y = A @ [3.0, -2.0] + np.einsum("mrn,mn->mr", turns, drawn)
    y = y + SIGMA * rng.standard_normal((m, 3))
    y[list(off)] += size * SIGMA / np.sqrt(3)
    noise = np.full((m, 3), SIGMA)
    if correlated:
        whole = SIGMA**2 * (0.7 * np.eye(3) + 0.3)
        noise = CorrelatedNoise.by_row(np.tile(whole, (m, 1, 1)))
    pieces = PieceColumns(shared, turns, rng.standard_normal((poses, 4))[pose], np.ones(4))
    columns = MissingColumns(pieces, pose, known)
    return BesideModel(A, y, noise, columns, 0.1)


@pytest.mark.parametrize("correlated", [False, True])
@pytest.mark.parametrize("aside", [[4], [4, 5], [0, 7, 20]])
def test_chances_are_those_of_predictions_by_the_rest(aside, correlated):
    """The rest predicts readings with the conditional mean and covariance of all that is normal."""
    one = given(1, correlated=correlated)
    m, n = len(one.A), one.measured.size
    sizes = np.array([SIZES[3], SIZES[5], SIZES[6]])
    pieces = one.columns.pieces
    turns = sizes[2] * pieces.turns
    same = one.columns.pose[:, None] == one.columns.pose
    V = np.einsum("irn,jsn,ij->irjs", turns, turns, same).reshape(n, n)
    scales = np.where(pieces.kinds == 1, sizes[1], [sizes[0], 0.0, sizes[0], *[1.0] * 4])
    shared = pieces.shared(sizes[1]) * scales
    columns = [shared, one.columns.known]
    L = np.concatenate(columns, axis=-1).reshape(n, -1)
    single = CorrelatedNoise.of_any(one.noise, (m, 3)).blocks[0].covariance
    V = V + L @ L.T + np.einsum("irs,ij->irjs", single, np.eye(m)).reshape(n, n)
    X, y = one.A.reshape(n, -1), (one.measured - shared @ pieces.mean).ravel()
    out = np.isin(np.repeat(np.arange(m), 3), aside)
    B = np.linalg.inv(V[np.ix_(~out, ~out)])
    C = np.linalg.inv(X[~out].T @ B @ X[~out])
    k = C @ X[~out].T @ B @ y[~out]
    W = V[np.ix_(out, ~out)] @ B
    left = X[out] - W @ X[~out]
    error = y[out] - X[out] @ k - W @ (y[~out] - X[~out] @ k)
    of_error = V[np.ix_(out, out)] - W @ V[np.ix_(~out, out)] + left @ C @ left.T
    expected = []
    for i in range(len(aside)):
        own = slice(3 * i, 3 * i + 3)
        square = error[own] @ np.linalg.solve(of_error[own, own], error[own])
        expected.append(chi2.sf(square, 3))
    np.testing.assert_allclose(one._chances(np.array(aside), sizes, scales), expected, rtol=1e-6)


@pytest.mark.slow
def test_rows_that_are_off_are_told_and_sound_ones_are_not():
    """Two rows that would hide each other are found; of 20 sound days hardly one names a row."""
    found = [rows_beyond_model(given(seed), 4) for seed in range(20)]
    assert sum(len(rows) > 0 for rows in found) <= 1  # 0.2 are expected at a level of 1 %
    for seed in range(5):
        off = rows_beyond_model(given(seed, poses=20, repeats=3, off=(7, 20), size=12.0), 4)
        assert off.tolist() == [7, 20]
