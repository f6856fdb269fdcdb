"""The family of problems by which O4 is optimised, and the polygon that its multipliers prove."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.linalg.inverse import eigenpairs
from criteria.linalg.spectrum import (
    bounded_below,
    definite_parts,
    extreme_eigenvalues,
    largest_eigenvalue,
)
from criteria.linalg.typing import Array
from criteria.relaxable import Formulation, Relaxable, SpectralBand

if TYPE_CHECKING:
    import cvxpy as cp

PARALLEL = 1e-30  # determinant of two normals of length one, below which lines have no corner
OUTSIDE = 1e-9  # part of its terms by which a corner may violate a half-plane, from rounding


class SpectralBalance(Relaxable):
    """``a kappa + b s = (a lambda_1 + b) / lambda_p``, for designs of one experiment's weight.

    Quasiconvex, with the condition number ``kappa = lambda_1/lambda_p`` and the largest variance
    ``s = 1/lambda_p``. The criterion is homogeneous only if b grows with the information, hence no
    law suite checks it; it serves `NoiseAmplification`, for which a and b are set anew each time.

    Args:
        a: Weight of the condition number, at least zero.
        b: Weight of the largest variance, positive.
    """

    name = "O4"
    title = "Weighted condition number and largest variance"
    formula = "(a lambda_1 + b) / lambda_p"
    sense = "min"
    degree = 1.0
    convex = False
    of_spectrum = True
    smooth = False

    def __init__(self, a: float, b: float) -> None:
        self.a = a
        self.b = b
        self.monotone = a == 0

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """``min a kappa + b s`` over ``I <= sum u_i M_i <= kappa I``, with s the sum of u."""
        low, high = extreme_eigenvalues(T)
        kappa = self.a * high / low / unit * largest_eigenvalue(M, T)
        return kappa + self.b / low / unit * total, [bounded_below(M, T)]

    def spectral_band(self, p: int) -> SpectralBand:
        """``min a kappa + b sum(w)`` over ``I <= M(w) <= kappa I``."""
        return SpectralBand.of(self.a, self.b, p)

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The least of ``a kappa + b s`` over the corners of the polygon, see `corners`."""
        return float(min(self.a * kappa + self.b * s for s, kappa in corners(Z, t)))

    def _cost(self, M: Array, cov: Array) -> Array:
        return (self.a * np.linalg.eigvalsh(M)[..., -1] + self.b) * np.linalg.eigvalsh(cov)[..., -1]

    def _gradient(self, M: Array, cov: Array) -> Array:
        """``a v_1 v_1'/lambda_p - (a lambda_1 + b) v_p v_p'/lambda_p^2``."""
        eigenvalues, V = eigenpairs(M)
        least = eigenvalues[..., :1]
        slopes = np.zeros_like(eigenvalues)
        # With a single parameter both terms fall on the same eigenvalue, hence the sum.
        slopes[..., :1] = -(self.a * eigenvalues[..., -1:] + self.b) / least**2
        slopes[..., -1:] += self.a / least
        return (V * slopes[..., None, :]) @ np.swapaxes(V, -1, -2)


def corners(Z: Array, t: Array) -> Array:
    """Corners (c, 2) of the polygon of points (s, kappa) outside which no design lies.

    With ``Z = Z+ - Z-`` and ``X <= lambda_1 I``, every design X of ``<Z, X> <= t`` obeys
    ``lambda_p trace(Z+) - lambda_1 trace(Z-) <= t``. Divided by lambda_p that is the half-plane
    ``t s + trace(Z-) kappa >= trace(Z+)``. Besides, ``s >= 0`` and ``kappa >= 1``.

    Args:
        Z: Multipliers (r, p, p), symmetric.
        t: The largest sensitivity (r,) of a candidate to each.
    """
    above, below = definite_parts(Z)
    rows = np.column_stack([t, below, above])[(above > 0) & np.isfinite(t)]
    if not len(rows):
        return np.array([[0.0, 1.0]])
    rows /= rows[:, 2:]  # each line as ``g_1 s + g_2 kappa >= 1``
    # Lengths are measured in the largest coefficients: s and kappa are of order one below.
    unit = np.abs(rows[:, :2]).max(axis=0)
    unit[unit == 0] = 1.0
    quadrant = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, unit[1]]])
    rows = np.vstack([quadrant, rows / np.append(unit, 1.0)])
    origin = rows[:2, 2]
    found = np.maximum(_intersections(rows), origin)
    return (found if len(found) else origin[None]) / unit


def _intersections(rows: Array) -> Array:
    """Points (c, 2) where two lines cross without leaving any of the half-planes.

    Args:
        rows: Lines ``g x = h`` with half-planes ``g x >= h``, as rows (g_1, g_2, h) of (n, 3).
    """
    normals = rows[:, :2]
    heights = rows[:, 2]
    i, j = np.triu_indices(len(rows), 1)
    # Cramer's rule: of a few dozen pairs it takes a fifth of the time of a solver.
    determinant = normals[i, 0] * normals[j, 1] - normals[i, 1] * normals[j, 0]
    lengths = np.linalg.norm(normals, axis=1)
    # Parallel lines have no corner, nor have lines with an infinite coefficient: their det is nan.
    cross = np.abs(determinant) > PARALLEL * lengths[i] * lengths[j]
    i = i[cross]
    j = j[cross]
    x = heights[i] * normals[j, 1] - heights[j] * normals[i, 1]
    y = heights[j] * normals[i, 0] - heights[i] * normals[j, 0]
    points = np.column_stack([x, y]) / determinant[cross, None]
    slack = OUTSIDE * np.abs(points) @ np.abs(normals).T
    inside = (points @ normals.T >= heights - slack).all(axis=1)
    return points[inside]
