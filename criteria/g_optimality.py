"""G-optimality, as the paper prints it."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Array, Criterion
from criteria.inverse import root_trace
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class GOptimality(Criterion):
    """Largest variance of a parameter, ``max diag(cov)``; Table 1's "diag(k)" is read as diag(cov(k)).

    This is the paper's G; elsewhere G means the largest variance of a prediction over the candidates.
    Subgradient: ``-c c'`` for the column c of cov that holds the largest diagonal entry.
    """

    name = "G"
    title = "G-optimality"
    formula = "max diag(cov)"
    sense = "min"
    degree = 1.0
    smooth = False

    def _cost(self, M: Array, cov: Array) -> Array:
        return np.diagonal(cov, axis1=-2, axis2=-1).max(axis=-1)

    def _gradient(self, M: Array, cov: Array) -> Array:
        worst = np.diagonal(cov, axis1=-2, axis2=-1).argmax(axis=-1)
        c = np.take_along_axis(cov, worst[..., None, None], axis=-1)
        return -c @ np.swapaxes(c, -1, -2)

    def polar(self, Z: Array, M: Array) -> float:
        """``(trace (U^(1/2) Z U^(1/2))^(1/2))^2`` with U = diag(u), valid for any weights u of sum one.

        The largest variance is at least any weighted mean of them, whose polar is that of a weighted
        A-criterion; at the optimum ``Z = cov U cov``, hence the choice ``u ~ diag(M Z M)``.
        """
        u = np.maximum(np.einsum("ij,jk,ki->i", M, Z, M), 0.0)
        root = np.sqrt(u / u.sum())
        return root_trace(root[:, None] * Z * root) ** 2

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """``max_j t_j M^-1 t_j'`` over the rows t_j of T."""
        import cvxpy as cp

        rows = np.eye(M.shape[0]) if T is None else T
        return cp.max(cp.hstack([cp.matrix_frac(t, M) for t in rows]))
