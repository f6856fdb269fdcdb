"""Variances of tracker, joints and discrepancy by residual maximum likelihood."""

import numpy as np

from edtk.inference.visited import PoseErrors, Visited
from edtk.system.typing import Array, Mask

ITERATIONS = 100  # of Fisher scoring; ten are the rule
SETTLED = 1e-8  # relative change of the variances
# Factors by which a variance grows or falls in one step, at most.
GROWTH = 4.0
FALL = 100.0
SMALL = 1e-9  # of its start, a variance that is zero


def fit_variances(seen: Visited, told: Mask) -> tuple[Array, Array]:
    """Fit ``V = v_0 I + v_1 C C' + v_2 E E'`` to whitened residuals (Patterson and Thompson 1971).

    The residual likelihood is that of what the compliances leave. With
    ``P = V^-1 - V^-1 Q (Q' V^-1 Q)^-1 Q' V^-1`` and ``V_i = dV/dv_i``, Fisher scoring solves

        1/2 tr(P V_i P V_j) dv_j = 1/2 (z' P V_i P z - tr(P V_i)).

    A variance that falls to nothing stays zero, but that of the tracker.

    Args:
        seen: The residuals.
        told: Mask (3,) of the variances that can be told; the others are zero.

    Returns:
        Variances (3,), and their covariance (3, 3); NaN where a variance is zero.

    Raises:
        numpy.linalg.LinAlgError: The residuals do not tell the variances apart.
    """
    poses = list(seen.poses())
    v = _start(poses, told)
    least = SMALL * np.where(v > 0, v, 1.0)
    free = told & (v > 0)
    for _ in range(ITERATIONS):
        slope, F = _scores(poses, v)
        step = np.zeros(3)
        step[free] = np.linalg.solve(F[np.ix_(free, free)], slope[free])
        after = np.where(free, np.clip(v + step, v / FALL, v * GROWTH), v)
        # Without any error of the tracker nothing could be whitened.
        after[0] = max(after[0], least[0])
        gone = free & (after < least)
        after[gone] = 0.0
        free &= ~gone
        settled = np.abs(after - v).max() <= SETTLED * v.max() and _close(after, v, free)
        v = after
        if settled:
            break
    covariance = np.full((3, 3), np.nan)
    _, F = _scores(poses, v)
    covariance[np.ix_(free, free)] = np.linalg.inv(F[np.ix_(free, free)])
    return v, covariance


def _close(after: Array, before: Array, free: Mask) -> bool:
    """Whether no variance changes any more; they differ by powers of ten."""
    return bool((np.abs(after - before)[free] <= SETTLED * before[free]).all())


def _start(poses: list[PoseErrors], told: Mask) -> Array:
    """Variances (3,), each of which alone would make all the residuals."""
    squares = sum(float(pose.residual @ pose.residual) for pose in poses)
    sizes = np.array([[len(p.residual), (p.apart**2).sum(), (p.shared**2).sum()] for p in poses])
    total = sizes.sum(axis=0)
    start = squares / np.where(total > 0, total, 1.0) / 3
    return np.where(told & (total > 0), start, 0.0)


def _scores(poses: list[PoseErrors], v: Array) -> tuple[Array, Array]:
    """Slope (3,) of the residual log-likelihood, and Fisher's information (3, 3)."""
    p = poses[0].Q.shape[1]
    square = np.zeros((p, p))
    onto = np.zeros(p)
    G = np.zeros((3, p, p))
    B = np.zeros((3, 3, p, p))
    g = np.zeros((3, p))
    traces = np.zeros(3)
    products = np.zeros((3, 3))
    squares = np.zeros(3)
    for pose in poses:
        parts = [np.eye(len(pose.residual)), pose.apart @ pose.apart.T, pose.shared @ pose.shared.T]
        inverse = np.linalg.inv(sum(one * part for one, part in zip(v, parts, strict=True)))
        X = inverse @ pose.Q
        y = inverse @ pose.residual
        K = np.stack([inverse @ part for part in parts])
        VX = np.stack([part @ X for part in parts])
        Vy = np.stack([part @ y for part in parts])
        square += pose.Q.T @ X
        onto += pose.Q.T @ y
        G += X.T @ VX
        g += Vy @ X
        B += np.swapaxes(VX, 1, 2)[:, None] @ (inverse @ VX)[None]
        traces += np.einsum("iaa->i", K)
        products += K.reshape(3, -1) @ np.swapaxes(K, 1, 2).reshape(3, -1).T
        squares += Vy @ y
    H = np.linalg.inv(square)
    k = H @ onto
    # z' P V_i P z, tr(P V_i) and tr(P V_i P V_j), with what was fitted taken out.
    squares = squares - 2 * g @ k + np.einsum("p,ipq,q->i", k, G, k)
    HG = H @ G
    traces = traces - np.einsum("ipp->i", HG)
    products = products - 2 * np.einsum("pq,ijqp->ij", H, B) + np.einsum("ipq,jqp->ij", HG, HG)
    return 0.5 * (squares - traces), 0.5 * products
