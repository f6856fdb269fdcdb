"""O4, the noise amplification index."""

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Array, Criterion, Formulation
from criteria.linalg.soft_maximum import conjugate, soft_maximum
from criteria.linalg.spectrum import bounded_below, extremes, largest, parts
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class NoiseAmplification(Criterion):
    """``s_p^2 / s_1`` (Table 1), s the singular values of the stacked A/sigma.

    Neither convex nor monotone: information in the strongest direction lowers it. The cost is
    ``f = sqrt(lambda_1) / lambda_p`` with gradient ``f (v_1 v_1'/(2 lambda_1) - v_p v_p'/lambda_p)``.

    It is optimised over a family of convex problems. Let ``s = 1/lambda_p`` and ``kappa = lambda_1/lambda_p``;
    then ``f^2 = s kappa``, and the points (s, kappa) that designs reach or exceed form a convex set. A problem
    ``min a kappa + b s`` gives a supporting line of it. The product s kappa takes its least value
    over the polygon that such lines leave in a corner of it, so the least corner is a bound on every design, not
    only on those of the family; the line that is added next cuts that corner off.

    Args:
        sharpness: Exponent of the soft maximum for the largest eigenvalues of M and cov; inf for the maximum itself.
    """

    name = "O4"
    title = "Noise amplification index"
    formula = "s_p^2 / s_1"
    sense = "max"
    degree = 0.5
    convex = False
    smooth = False
    monotone = False

    def __init__(self, sharpness: float = np.inf) -> None:
        self.sharpness, self.smooth = sharpness, bool(np.isfinite(sharpness))

    def _cost(self, M: Array, cov: Array) -> Array:
        high, low = (soft_maximum(np.linalg.eigvalsh(X), self.sharpness)[0] for X in (M, cov))
        return np.sqrt(high) * low

    def _gradient(self, M: Array, cov: Array) -> Array:
        m, V = np.linalg.eigh(M)
        c, U = np.linalg.eigh(cov)
        (high, v), (low, u) = soft_maximum(m, self.sharpness), soft_maximum(c, self.sharpness)
        G = conjugate(V, 0.5 * v / high[..., None]) - conjugate(U, u * c**2 / low[..., None])
        return (np.sqrt(high) * low)[..., None, None] * G

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """``sqrt(s kappa)`` at the least corner of the polygon that the multipliers prove, see `_corner`."""
        return float(np.sqrt(np.prod(_corner(Z, t))))

    def subproblem(self, Z: Array, t: Array, M: Array) -> Criterion:
        """The member of the family that cuts off the least corner; the first is set by the design M."""
        m = np.linalg.eigvalsh(M)
        s, kappa = _corner(Z, t) if len(Z) else (1.0 / m[0], m[-1] / m[0])
        return SpectralBalance(0.0, 1.0) if s == 0 else SpectralBalance(1.0 / kappa, 1.0 / s)

    def smoothed(self, sharpness: float) -> "NoiseAmplification":
        """Soft maxima of the eigenvalues of M and of cov in place of the largest ones."""
        return NoiseAmplification(sharpness)


class SpectralBalance(Criterion):
    """``a kappa + b s = (a lambda_1 + b) / lambda_p`` of designs of one experiment's weight: quasiconvex.

    Args:
        a: Weight of the condition number ``kappa = lambda_1/lambda_p``, at least zero.
        b: Weight of the largest variance ``s = 1/lambda_p``, positive.
    """

    name = "O4"
    title = "Weighted condition number and largest variance"
    formula = "(a lambda_1 + b) / lambda_p"
    sense = "min"
    degree = 1.0
    convex = False
    smooth = False

    def __init__(self, a: float, b: float) -> None:
        self.a, self.b = a, b
        self.monotone = a == 0

    def _cost(self, M: Array, cov: Array) -> Array:
        return (self.a * np.linalg.eigvalsh(M)[..., -1] + self.b) * np.linalg.eigvalsh(cov)[..., -1]

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """Homogenised: ``min a kappa + b s`` over ``I <= sum u_i M_i <= kappa I`` with s the sum of u."""
        low, high = extremes(T)
        return self.a * high / low / unit * largest(M, T) + self.b / low / unit * total, [
            bounded_below(M, T)
        ]

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The least of ``a kappa + b s`` over the corners of the half-planes that the multipliers prove."""
        return float(min(self.a * kappa + self.b * s for s, kappa in _corners(Z, t)))


def _corners(Z: Array, t: Array) -> Array:
    """Corners (c, 2) of the polygon of points (s, kappa) that no design falls out of.

    With ``Z = Z+ - Z-`` and ``X <= lambda_1 I``, every design X of ``<Z, X> <= t`` obeys
    ``lambda_p trace(Z+) - lambda_1 trace(Z-) <= t``; divided by lambda_p that is the half-plane
    ``t s + trace(Z-) kappa >= trace(Z+)``. Besides, ``s >= 0`` and ``kappa >= 1``.
    """
    above, below = parts(Z)
    rows = np.column_stack([t, below, above])[(above > 0) & np.isfinite(t)]
    if not len(rows):
        return np.array([[0.0, 1.0]])
    rows /= rows[:, 2:]
    unit = np.abs(rows[:, :2]).max(axis=0)
    unit[unit == 0] = 1.0  # one over the size of s and kappa, which are of order one below
    quadrant = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, unit[1]]])
    rows = np.vstack([quadrant, rows / np.append(unit, 1.0)])
    found: list[Array] = []
    for u, v in combinations(rows, 2):
        G = np.stack([u[:2], v[:2]])
        if abs(np.linalg.det(G)) > 1e-30 * np.prod(np.linalg.norm(G, axis=1)):
            corner = np.linalg.solve(G, [u[2], v[2]])
            if (
                rows[:, :2] @ corner >= rows[:, 2] - 1e-9 * np.abs(rows[:, :2]) @ np.abs(corner)
            ).all():
                found.append(np.maximum(corner, rows[:2, 2]))
    return np.array(found or [rows[:2, 2]]) / unit


def _corner(Z: Array, t: Array) -> Array:
    """The corner (2,) with the least product s kappa."""
    corners = _corners(Z, t)
    return np.asarray(corners[corners.prod(axis=1).argmin()])
