"""Variances of several kinds of errors by residual maximum likelihood."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array, Mask

ITERATIONS = 60  # of Fisher scoring; ten are the rule
SETTLED = 1e-4  # relative change of what a variance adds to the total
HALVINGS = 4  # of a step that lowers the likelihood, before a step that cannot takes its place


@dataclass(frozen=True, eq=False)
class BlockVariances:
    """Variances, and how well they are known.

    Attributes:
        variances: One a kind (c,).
        covariance: Of these (c, c); infinite where a variance is zero and so not bounded below.
        log_likelihood: The residual log-likelihood, up to a constant.
    """

    variances: Array
    covariance: Array
    log_likelihood: float

    def relative_dof(self, slopes: Array) -> Array:
        """Degrees of freedom (...,) of sums ``slopes v``: ``2 mean^2 / variance`` (Satterthwaite).

        Args:
            slopes: Sums' derivatives (..., c) by the variances.
        """
        mean = slopes @ self.variances
        spread = np.einsum("...i,ij,...j->...", slopes, self.covariance, slopes)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(spread > 0, 2 * mean**2 / spread, np.inf)


def fit_variances_of_blocks(
    fixed: Array, kinds: Sequence[Array], residual: Array, design: Array, told: Mask | None = None
) -> BlockVariances:
    """Fit ``V_b = F_b + sum_i v_i K_ib`` to independent blocks b of residuals.

    The residual likelihood (Patterson and Thompson 1971) is that of what the design leaves. Fisher
    scoring solves ``1/2 tr(P K_i P K_j) dv_j = 1/2 (z' P K_i P z - tr(P K_i))`` for the variances
    that are not held at zero. Where its step lowers the likelihood, each variance is multiplied by
    ``sqrt(z' P K_i P z / tr(P K_i))`` instead, which never does (Zhou, Hu, Zhou and Lange 2019).

    Args:
        fixed: Known covariances F (b, r, r).
        kinds: Matrices K_i (b, r, r) of each kind.
        residual: Residuals z (b, r) of any fit of the design.
        design: Columns (b, r, p) that were fitted; p may be zero.
        told: Mask (c,) of the kinds whose variances are fitted; the others are zero.
    """
    count = len(kinds)
    K = np.stack(kinds) if count else np.zeros((0, *fixed.shape))
    free = np.ones(count, dtype=bool) if told is None else np.array(told)
    square = float((residual**2).sum()) / residual.size
    size = np.einsum("cbrr->c", K) / residual.size
    v = np.where(free & (size > 0), square / np.where(size > 0, size, 1.0) / max(count, 1), 0.0)
    at = _scores(fixed, K, residual, design, v)
    for _ in range(ITERATIONS if count else 0):
        after, there = _step(at, v, free, lambda w: _scores(fixed, K, residual, design, w))
        settled = (np.abs(after - v) * size).max(initial=0.0) <= SETTLED * square
        v, at = after, there
        if settled:
            break
    products = at.products
    likelihood = at.likelihood
    covariance = np.zeros((count, count))
    known = np.flatnonzero(v > 0)
    if len(known):
        covariance[np.ix_(known, known)] = np.linalg.pinv(0.5 * products[np.ix_(known, known)])
    return BlockVariances(v, covariance, likelihood)


@dataclass(frozen=True, eq=False)
class _Scores:
    """Terms of the likelihood's slope.

    Attributes:
        quadratic: ``z' P K_i P z`` (c,).
        trace: ``tr(P K_i)`` (c,).
        products: ``tr(P K_i P K_j)`` (c, c).
        likelihood: The residual log-likelihood.
    """

    quadratic: Array
    trace: Array
    products: Array
    likelihood: float


def _step(
    at: _Scores, v: Array, free: Mask, scores: Callable[[Array], _Scores]
) -> tuple[Array, _Scores]:
    """The next variances (c,), and the scores there."""
    slope = 0.5 * (at.quadratic - at.trace)
    moving = np.flatnonzero(free & ((v > 0) | (slope > 0)))
    step = np.zeros_like(v)
    F = 0.5 * at.products[np.ix_(moving, moving)]
    step[moving] = np.linalg.lstsq(F, slope[moving], rcond=None)[0]
    for _ in range(HALVINGS):
        after = np.maximum(v + step, 0.0)
        try:
            there = scores(after)
        except np.linalg.LinAlgError:  # without any variance nothing could be inverted
            step = step / 2
            continue
        if there.likelihood >= at.likelihood - 1e-9 * abs(at.likelihood):
            return after, there
        step = step / 2
    # Neither is negative, but by rounding, where the design leaves next to no residuals.
    both = (v > 0) & (at.quadratic > 0) & (at.trace > 0)
    ratio = np.divide(at.quadratic, at.trace, out=np.ones_like(v), where=both)
    after = v * np.sqrt(ratio)
    try:
        return after, scores(after)
    except np.linalg.LinAlgError:
        return v, at


def _scores(fixed: Array, K: Array, z: Array, X: Array, v: Array) -> _Scores:
    """The terms at variances v (c,)."""
    V = fixed + np.einsum("c,cbrs->brs", v, K)
    L = np.linalg.cholesky(V)
    inverse = np.linalg.inv(V)
    W = inverse @ X
    # As products of two matrices: einsum alone sums over so many rows one by one.
    XW = np.tensordot(X, W, axes=((0, 1), (0, 1)))
    H = np.linalg.pinv(XW, hermitian=True)
    y = np.einsum("brs,bs->br", inverse, z)
    k = H @ np.einsum("brp,br->p", X, y)
    Pz = y - W @ k
    quadratic = np.einsum("br,cbrs,bs->c", Pz, K, Pz)
    own = inverse @ K
    KW = K @ W
    G = np.moveaxis(np.tensordot(W, KW, axes=((0, 1), (1, 2))), 1, 0)
    trace = np.einsum("cbrr->c", own) - np.einsum("pq,cqp->c", H, G)
    B = np.einsum("cbrp,brs,dbsq->cdpq", KW, inverse, KW, optimize=True)
    HG = H @ G
    products = (
        np.einsum("cbrs,dbsr->cd", own, own, optimize=True)
        - 2 * np.einsum("pq,cdqp->cd", H, B)
        + np.einsum("cpq,dqp->cd", HG, HG)
    )
    values = np.linalg.eigvalsh(XW) if X.shape[-1] else np.ones(1)
    log_design = float(np.log(values[values > 0]).sum())
    log_V = 2 * float(np.log(np.diagonal(L, axis1=1, axis2=2)).sum())
    likelihood = -0.5 * (log_V + log_design + float((z * Pz).sum()))
    return _Scores(quadratic, trace, products, likelihood)
