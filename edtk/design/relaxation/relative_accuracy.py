"""How many digits of a cost and of a bound rounding has left."""

import numpy as np

from criteria import Relaxable
from edtk.design.problem import Problem
from edtk.system.typing import Array

EPS = float(np.finfo(float).eps)


def relative_accuracy(
    problem: Problem,
    criterion: Relaxable,
    weights: Array,
    multipliers: Array,
    rounding: Array | None = None,
    of_squares: bool = False,
) -> float:
    """Bound the relative error that rounding makes in a cost and in its lower bound.

    *Cost.* Let W whiten the part of the design M that counts, ``W'M W = I``, and let M be wrong by
    dM. With ``delta = |W' dM W|`` the true matrix is between ``(1 - delta) M`` and
    ``(1 + delta) M``, and a monotone cost of degree d is wrong by the factor ``(1 + delta)^d`` at
    most. An entry of dM is a rounding of a sum of products, below ``p eps (M_ii M_jj)^(1/2)``.
    Rows ``X_i = A_i T`` of transformed parameters are wrong by E_i besides, which adds
    ``2 |W| (sum w_i |E_i|^2)^(1/2)`` to delta, as ``|X W| = 1``. Transformed squares that are wrong
    by E_i add ``|W|^2 sum w_i |E_i|``.

    *Bound.* It is proportional to ``t^-d``, t the largest sensitivity ``<Z, M_i>``. Rounding of a
    sensitivity is below ``2 p eps`` times that to ``p diag(Z)``; wrong rows add
    ``2 |E_i| (|Z| t_i)^(1/2)``, wrong squares ``|E_i| |Z|``. Criteria that are not monotone round
    their bounds down themselves, so that the gap has the loss; their costs are a product of an
    extreme of M and one of cov.

    First-order terms are counted; numbers as they were given are taken to be exact.

    Args:
        problem: The candidates (n).
        criterion: What was minimised.
        weights: Weights (n,).
        multipliers: Multipliers (r, p, p) of the bound.
        rounding: Bounds (n,) on ``|E_i|``, if rows or squares were transformed.
        of_squares: Whether they are of squares.

    Returns:
        The sum of both errors.
    """
    p = problem.p
    M = problem.information(weights)
    W = criterion.whitener(M)
    spread = np.linalg.norm(np.sqrt(np.maximum(np.diag(M), 0.0))[:, None] * W, 2) ** 2
    delta = p * p * EPS * spread
    if rounding is not None:
        size = float(np.linalg.norm(W, 2))
        if of_squares:
            delta += size**2 * float(weights @ rounding)
        else:
            delta += 2 * size * float(np.sqrt(weights @ rounding**2))
    if not criterion.monotone:
        return float((1 + criterion.degree) * delta)
    lost = max((_lost(problem, M, Z, rounding, of_squares) for Z in multipliers), default=0.0)
    return float(criterion.degree * (delta + lost))


def _lost(problem: Problem, M: Array, Z: Array, rounding: Array | None, of_squares: bool) -> float:
    """Relative error of the largest sensitivity to Z (p, p)."""
    p = problem.p
    own = np.abs(np.diag(Z))
    t = float(np.sum(Z * M))  # a little below t itself
    if not t > 0:
        return float("inf")
    error = 2 * p * p * EPS * float(own @ problem.largest)
    if rounding is not None:
        norm = float(np.abs(np.linalg.eigvalsh(Z)).max())
        if of_squares:
            return (error + norm * float(rounding.max())) / t
        along = np.sqrt(norm * np.maximum(problem.sensitivities(Z), 0.0))
        error += 2 * float((rounding * along).max())
    return error / t
