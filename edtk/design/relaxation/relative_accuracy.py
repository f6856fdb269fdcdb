"""How many digits of a cost and of a bound rounding has left."""

import numpy as np

from criteria import Relaxable
from criteria.linalg.root import unit_scale
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
    """Bound the relative error that rounding makes in a cost and in its lower bound: `errors`."""
    return sum(errors(problem, criterion, weights, multipliers, rounding, of_squares))


def errors(
    problem: Problem,
    criterion: Relaxable,
    weights: Array | None,
    multipliers: Array,
    rounding: Array | None = None,
    of_squares: bool = False,
) -> tuple[float, float]:
    """Bound the relative errors that rounding makes in a cost and in its lower bound.

    *Cost.* Let W whiten the part of the design M that counts, ``W'M W = I``, and let M be wrong by
    dM. With ``delta = |W' dM W|`` the true matrix is between ``(1 - delta) M`` and
    ``(1 + delta) M``, and a monotone cost of degree d is wrong by the factor ``(1 + delta)^d`` at
    most. An entry of dM is a rounding of a sum of products, below ``p eps (M_ii M_jj)^(1/2)``;
    where the criterion is about nearly dependent combinations, the square of that comes in besides.
    Rows ``X_i = A_i T`` of transformed parameters are wrong by E_i besides, which adds
    ``2 |W| (sum w_i |E_i|^2)^(1/2)`` to delta, as ``|X W| = 1``. Transformed squares that are wrong
    by E_i add ``|W|^2 sum w_i |E_i|``.

    *Bound.* It is proportional to ``t^-d``, t the largest sensitivity ``<Z, M_i>``. Rounding of a
    sensitivity is below ``2 p eps`` times that to ``p diag(Z)``; wrong rows add
    ``2 |E_i| (|Z| t_i)^(1/2)``, wrong squares ``|E_i| |Z|``. What Z proves is computed by roots
    and determinants of matrices that are conditioned as M is: the rounding of dM counts once more.
    Of criteria that are not monotone, costs and bounds are products of an extreme of M and one of
    cov, and a bound has the largest rounding of a row, not that of the weighted ones.

    Powers and determinants are exponentials of logarithms, each of which is rounded to eps of its
    size: the error of both counts ``eps`` for each decade that M and the cost are from one.

    First-order terms are counted; numbers as they were given are taken to be exact.

    Args:
        problem: The candidates (n).
        criterion: What was minimised.
        weights: Weights (n,); None for equal ones, with the largest rounding of a row.
        multipliers: Multipliers (r, p, p) of the bound.
        rounding: Bounds (n,) on ``|E_i|``, if rows or squares were transformed.
        of_squares: Whether they are of squares.

    Returns:
        The errors of the cost and of the bound; inf where nothing is known.
    """
    p = problem.p
    M = problem.mean if weights is None else problem.information(weights)
    W = criterion.whitener(M)
    own = np.maximum(np.diag(M), 0.0)
    spread = np.linalg.norm(np.sqrt(own)[:, None] * W, 2) ** 2
    scale = unit_scale(own)
    of_sums = float(p * p * EPS * spread * criterion.dependence(scale) ** 2)
    of_rows = _of_rows(W, weights, rounding, of_squares)
    of_powers = 4 * p * EPS * (1 + _size_of_logarithms(own, float(criterion.cost(M))))
    if not criterion.monotone:
        times = 1 + criterion.degree
        worst = of_sums + _of_rows(W, None, rounding, of_squares)
        return times * (of_sums + of_rows) + of_powers, times * worst + of_powers
    lost = max((_lost(problem, M, Z, rounding, of_squares) for Z in multipliers), default=0.0)
    of_cost = criterion.degree * (of_sums + of_rows) + of_powers
    return float(of_cost), float(criterion.degree * (of_sums + lost) + of_powers)


def _of_rows(W: Array, weights: Array | None, rounding: Array | None, of_squares: bool) -> float:
    """The part of delta that wrong rows or squares make, with these weights or with any."""
    if rounding is None:
        return 0.0
    size = float(np.linalg.norm(W, 2))
    if of_squares:
        return size**2 * float(rounding.max() if weights is None else weights @ rounding)
    squares = np.square(rounding)
    return 2 * size * float(np.sqrt(squares.max() if weights is None else weights @ squares))


def _size_of_logarithms(own: Array, cost: float) -> float:
    """The size of the logarithms of the entries of a diagonal (p,) and of a cost, the largest."""
    numbers = np.append(own, cost)
    told = numbers[np.isfinite(numbers) & (numbers > 0)]
    return float(np.abs(np.log(told)).max(initial=0.0))


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
