"""Variances of errors by restricted likelihood."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from edtk.fit.restricted_likelihood import Blocks, fit_variances


def test_variances_of_kinds_are_found() -> None:
    """Of many blocks the fitted variances of white and common errors are near the true ones."""
    rng = np.random.default_rng(0)
    b, r = 400, 6
    common = np.ones((b, r, r))
    eye = np.broadcast_to(np.eye(r), (b, r, r))
    z = 0.3 * rng.standard_normal((b, r)) + 0.8 * rng.standard_normal((b, 1))
    X = rng.standard_normal((b, r, 5))
    found = fit_variances([Blocks(np.zeros((b, r, r)), [eye, common], z, X)])
    std = np.sqrt(np.diag(found.covariance))
    np.testing.assert_array_less(np.abs(found.variances - [0.09, 0.64]), 4 * std)
    # Of n normal numbers a variance has 2 v^2 / n: 2000 for the white one.
    assert std[0] == pytest.approx(0.09 * np.sqrt(2 / (b * (r - 1))), rel=0.1)
    none = fit_variances([Blocks(eye, [eye], rng.standard_normal((b, r)) * 0.5, X)])
    assert none.variances[0] == 0.0


def test_information_of_variances_is_that_of_the_whole_matrices() -> None:
    """``tr(P K_i P K_j)/2`` of blocks, of several kinds, is that of the matrices of all rows."""
    rng = np.random.default_rng(3)
    b, r = 60, 4
    kinds = [np.broadcast_to(np.diag(one), (b, r, r)) for one in np.eye(r)[:2]]
    moved = rng.standard_normal((b, r, 1))
    kinds.append(moved @ np.swapaxes(moved, 1, 2))
    X = rng.standard_normal((b, r, 5))
    fixed = np.broadcast_to(0.1 * np.eye(r), (b, r, r))
    z = rng.standard_normal((b, r))
    found = fit_variances([Blocks(fixed, kinds, z, X)])
    assert (found.variances > 0).all()
    V = fixed + sum(v * K for v, K in zip(found.variances, kinds, strict=True))
    inverse = block_diag(*np.linalg.inv(V))
    columns = X.reshape(-1, 5)
    seen = inverse @ columns
    P = inverse - seen @ np.linalg.solve(columns.T @ seen, seen.T)
    PK = [P @ block_diag(*K) for K in kinds]
    information = 0.5 * np.array([[np.trace(a @ c) for c in PK] for a in PK])
    np.testing.assert_allclose(np.linalg.inv(found.covariance), information, rtol=1e-8)


def test_blocks_of_different_sizes_are_one_likelihood() -> None:
    """Where each pose has as many rows as it likes, all together have the slope of no likelihood.

    ``z' P K_i P z = tr(P K_i)`` holds for the matrices of all rows, at kinds whose sizes differ by
    ten powers of ten.
    """
    rng = np.random.default_rng(5)
    parts = []
    for b, r in ((20, 3), (7, 5), (4, 9)):
        moved = 1e5 * rng.standard_normal((b, r, 2))
        kinds = [np.broadcast_to(np.eye(r), (b, r, r)), moved @ np.swapaxes(moved, 1, 2)]
        common = 1e-5 * (moved @ rng.standard_normal((b, 2, 1)))[..., 0]
        z = 0.5 * rng.standard_normal((b, r)) + common
        parts.append(Blocks(np.zeros((b, r, r)), kinds, z, rng.standard_normal((b, r, 4))))
    found = fit_variances(parts, settled=1e-10)
    whole = [block_diag(*(K for part in parts for K in part.kinds[i])) for i in range(2)]
    inverse = np.linalg.inv(sum(v * K for v, K in zip(found.variances, whole, strict=True)))
    X = np.concatenate([part.design.reshape(-1, 4) for part in parts])
    z = np.concatenate([part.residual.reshape(-1) for part in parts])
    P = inverse - inverse @ X @ np.linalg.solve(X.T @ inverse @ X, X.T @ inverse)
    for K in whole:
        assert z @ P @ K @ P @ z == pytest.approx(np.trace(P @ K), rel=1e-6)


def test_without_other_errors_the_white_variance_is_the_mean_square() -> None:
    """Where no variance but the white one is there, it is the squares over degrees of freedom."""
    rng = np.random.default_rng(2)
    b, r, p = 30, 4, 6
    eye = np.broadcast_to(np.eye(r), (b, r, r))
    X = rng.standard_normal((b, r, p))
    Q = np.linalg.qr(X.reshape(-1, p))[0]
    z = rng.standard_normal(b * r)
    z -= Q @ (Q.T @ z)
    alike = np.ones((b, r, r))
    told = np.array([True, False])
    found = fit_variances([Blocks(0 * eye, (eye, alike), z.reshape(b, r), X)], told, 1e-10)
    assert found.variances == pytest.approx([z @ z / (b * r - p), 0.0])
