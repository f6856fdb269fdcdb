"""Singular values of a matrix whose columns have very different lengths, each to all digits."""

import numpy as np

from criteria.linalg.typing import Array

EPS = float(np.finfo(float).eps)
SWEEPS = 30  # a dozen are the rule
FEW = 4.0  # multiple of ``p eps`` of their lengths up to which a product of columns is zero


def orthogonal_columns(T: Array) -> Array:
    """``T J`` with orthogonal columns, for an orthogonal J: by one-sided Jacobi rotations.

    The lengths of the columns are the singular values of T. Each pair of columns is turned until
    their product is a rounding beside their own lengths, not beside the longest of all. So short
    columns keep their digits, however long the others are, where a bidiagonalization leaves a
    rounding of the longest (Demmel and Veselic, SIAM J. Matrix Anal. Appl. 13, 1992).

    Args:
        T: Regular matrix (p, p), best with its longest columns first.
    """
    p = T.shape[1]
    T = np.array(T, dtype=float)
    if p < 2:
        return T
    least = FEW * p * EPS
    for _ in range(SWEEPS):
        most = 0.0
        for first, second in _pairs(p):
            most = max(most, _turn(T, first, second))
        if most <= least:
            break
    return T


def have_orthogonal_columns(T: Array) -> bool:
    """Whether the columns of T (p, p) are orthogonal but for rounding, whatever their lengths."""
    lengths = np.linalg.norm(T, axis=0)
    if not (lengths > 0).all():
        return False
    unit = T / lengths
    p = T.shape[1]
    return bool(np.abs(unit.T @ unit - np.eye(p)).max() <= 4 * FEW * p * EPS)


def _pairs(p: int) -> list[tuple[Array, Array]]:
    """Rounds in which each pair of p columns meets once, as players of a tournament do."""
    players = list(range(p + p % 2))
    half = len(players) // 2
    rounds = []
    for _ in range(len(players) - 1):
        pairs = [
            sorted(pair)
            for pair in zip(players[:half], reversed(players[half:]), strict=True)
            if max(pair) < p
        ]
        first, second = np.array(pairs, dtype=int).T
        rounds.append((first, second))
        players = [players[0], players[-1], *players[1:-1]]
    return rounds


def _turn(T: Array, first: Array, second: Array) -> float:
    """Turn pairs of columns of T, in place, until each pair is orthogonal.

    Returns:
        The largest cosine of a pair before.
    """
    x = T[:, first]
    y = T[:, second]
    a = np.einsum("ij,ij->j", x, x)
    b = np.einsum("ij,ij->j", y, y)
    c = np.einsum("ij,ij->j", x, y)
    cosine = np.abs(c) / np.sqrt(a * b)
    turned = cosine > EPS
    zeta = (b - a) / (2 * np.where(turned, c, 1.0))
    # The smaller of the two angles, as a tangent: the long column stays the long one.
    sign = np.where(zeta >= 0, 1.0, -1.0)
    t = np.where(turned, sign / (np.abs(zeta) + np.hypot(1.0, zeta)), 0.0)
    cos = 1.0 / np.hypot(1.0, t)
    T[:, first] = cos * x - cos * t * y
    T[:, second] = cos * t * x + cos * y
    return float(cosine.max())
