"""Variances of errors by restricted likelihood."""

import tracemalloc
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import block_diag

from edtk.fit.restricted_likelihood import Blocks, _scores, fit_variances
from edtk.measure.few_columns import FewColumns
from edtk.measure.whitening import Scatter

Array = NDArray[np.float64]


def test_variances_of_kinds_are_found() -> None:
    """Of many blocks the fitted variances of white and common errors are near the true ones."""
    rng = np.random.default_rng(0)
    b, r = 400, 6
    common = np.ones((b, r, r))
    eye = np.broadcast_to(np.eye(r), (b, r, r))
    z = 0.3 * rng.standard_normal((b, r)) + 0.8 * rng.standard_normal((b, 1))
    X = rng.standard_normal((b, r, 5))
    found = fit_variances([Blocks.dense(np.zeros((b, r, r)), [eye, common], z, X)])
    std = np.sqrt(np.diag(found.covariance))
    np.testing.assert_array_less(np.abs(found.variances - [0.09, 0.64]), 4 * std)
    # Of n normal numbers a variance has 2 v^2 / n: 2000 for the white one.
    assert std[0] == pytest.approx(0.09 * np.sqrt(2 / (b * (r - 1))), rel=0.1)
    none = fit_variances([Blocks.dense(eye, [eye], rng.standard_normal((b, r)) * 0.5, X)])
    assert none.variances[0] == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_a_fit_ends_where_rounding_hides_the_likelihood(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kinds that are far larger than what is known leave digits for the variances, and no more."""
    rng = np.random.default_rng(seed)
    r = 18
    Q = np.linalg.qr(rng.standard_normal((r, r)))[0]
    C = (Q * np.geomspace(1e-10, 1e-6, r)) @ Q.T
    U = rng.standard_normal((2, r, 8))
    y = (U @ rng.standard_normal((8, 1)))[..., 0]
    y = [1e3, 10] @ y + np.linalg.cholesky(C) @ rng.standard_normal(r)
    calls = []

    def counted(blocks: Sequence[Blocks], v: Array) -> Any:
        calls.append(v)
        return _scores(blocks, v)

    monkeypatch.setattr("edtk.fit.restricted_likelihood._scores", counted)
    kinds = [(one @ one.T)[None] for one in U]
    found = fit_variances([Blocks.dense(C[None], kinds, y[None], rng.standard_normal((1, r, 1)))])
    assert len(calls) < 60  # of more than three hundred that are allowed
    # Of eight normal numbers: a factor of five either way is one of a thousand.
    np.testing.assert_array_less(np.abs(np.log(found.variances / [1e6, 100])), np.log(5))


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
    found = fit_variances([Blocks.dense(fixed, kinds, z, X)])
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
        parts.append(Blocks.dense(np.zeros((b, r, r)), kinds, z, rng.standard_normal((b, r, 4))))
    found = fit_variances(parts, settled=1e-10)
    whole = [block_diag(*(K for part in parts for K in part.kinds[i][:, 0])) for i in range(2)]
    inverse = np.linalg.inv(sum(v * K for v, K in zip(found.variances, whole, strict=True)))
    X = np.concatenate([part.design.dense.reshape(-1, 4) for part in parts])
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
    found = fit_variances([Blocks.dense(0 * eye, (eye, alike), z.reshape(b, r), X)], told, 1e-10)
    assert found.variances == pytest.approx([z @ z / (b * r - p), 0.0])


def kinds_of_a_day(rng: np.random.Generator, poses: int, markers: int) -> list[Array]:
    """Kinds of noise: white, a tracker's, one axis, joints of the robot, and one more joint."""
    r = 3 * markers
    root = rng.standard_normal((poses, markers, 3, 3))
    joints = rng.standard_normal((poses, r, 4))
    axis = np.broadcast_to(np.diag([0.0, 0.0, 1.0]), root.shape)
    white = np.broadcast_to(np.eye(3), root.shape)
    return [white, root @ np.swapaxes(root, -1, -2), axis, joints[..., :3], joints[..., 3:]]


def test_scores_of_instruments_are_those_of_whole_matrices() -> None:
    """Slope and information of any kinds are those of ``P`` and ``K`` of all rows, written out."""
    rng = np.random.default_rng(8)
    poses, markers = 7, 4
    r = 3 * markers
    kinds = kinds_of_a_day(rng, poses, markers)
    known = Scatter(0.2 * np.ones((poses, markers, 3, 3)) + np.eye(3), kinds[3][..., :2])
    X = np.zeros((poses, r, 5 + r))
    X[..., :5] = rng.standard_normal((poses, r, 5))
    X[:, np.arange(r), 5 + np.arange(r)] = rng.standard_normal((poses, r))
    z = rng.standard_normal((poses, r))
    v = np.array([0.3, 0.2, 0.0, 0.5, 0.1])
    blocks = Blocks(known, kinds, z, FewColumns.among(X, markers))
    at = _scores([blocks], v)

    still = np.zeros((poses, r, 0))
    whole = [
        block_diag(
            *(kind @ np.swapaxes(kind, 1, 2) if kind.ndim == 3 else Scatter(kind, still).dense)
        )
        for kind in kinds
    ]
    V = block_diag(*known.dense) + sum(a * K for a, K in zip(v, whole, strict=True))
    inverse, flat = np.linalg.inv(V), X.reshape(-1, X.shape[-1])
    M = flat.T @ inverse @ flat
    P = inverse - inverse @ flat @ np.linalg.solve(M, flat.T @ inverse)
    y = P @ z.ravel()
    np.testing.assert_allclose(at.quadratic, [y @ K @ y for K in whole], rtol=1e-9)
    np.testing.assert_allclose(at.trace, [np.trace(P @ K) for K in whole], rtol=1e-9)
    products = [[np.trace(P @ K @ P @ L) for L in whole] for K in whole]
    np.testing.assert_allclose(at.products, products, rtol=1e-9, atol=1e-10)
    logs = np.linalg.slogdet(V)[1] + np.linalg.slogdet(M)[1]
    assert at.likelihood == pytest.approx(-0.5 * (logs + z.ravel() @ y), rel=1e-10)


def test_many_markers_need_no_matrix_of_all_their_rows() -> None:
    """The variances of 100 markers in 20 poses are fitted in less memory than one V takes."""
    rng = np.random.default_rng(9)
    poses, markers = 20, 100
    r = 3 * markers
    white, _, _, joints, _ = kinds_of_a_day(rng, poses, markers)
    part = rng.standard_normal((poses, markers, 3, 9))
    own = 6 + np.arange(r).reshape(markers, 3)
    of = np.concatenate([np.tile(np.arange(6), (markers, 1)), own], axis=1)
    fixed = Scatter(0.1 * white, joints[..., :0])
    z = rng.standard_normal((poses, r)) + (joints @ rng.standard_normal((poses, 3, 1)))[..., 0]
    blocks = Blocks(fixed, [white, joints], z, FewColumns(part, of, 6 + r))
    tracemalloc.start()
    found = fit_variances([blocks])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 * poses * r**2
    np.testing.assert_array_less(np.abs(found.variances - [0.9, 1.0]), [0.1, 0.6])
