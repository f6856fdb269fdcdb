"""Cost, gradient and polar of a criterion that is known by its cvxpy expression alone."""

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from criteria.linalg.inverse import whitener

if TYPE_CHECKING:
    import cvxpy as cp

    from criteria.criterion import Criterion

Array = NDArray[np.float64]


def cost_of(criterion: "Criterion", M: Array) -> Array:
    """Costs (...) of regular M (..., p, p): ``expression^(1/power)``, one matrix after the other."""
    values = [float(_at(criterion, m)[0].value) for m in M.reshape(-1, *M.shape[-2:])]
    return np.array(values).reshape(M.shape[:-2]) ** (1.0 / criterion.expression_power)


def gradient_of(criterion: "Criterion", M: Array) -> Array:
    """Gradients (..., p, p) of the cost, by cvxpy's own differentiation and the chain rule.

    With ``e = cost^power`` the gradient of the cost is ``cost^(1 - power)/power`` times that of e.
    """
    found = []
    for m in M.reshape(-1, *M.shape[-2:]):
        expression, X = _at(criterion, m)
        G = expression.grad[X]
        G = np.asarray(G.todense() if hasattr(G, "todense") else G).reshape(m.shape, order="F")
        e, power = float(expression.value), criterion.expression_power
        found.append(e ** (1.0 / power - 1.0) / power * 0.5 * (G + G.T))
    return np.array(found).reshape(M.shape)


def polar_of(criterion: "Criterion", Z: Array, M: Array) -> float:
    """``min {cost(X): <Z, X> <= 1}`` for a psd Z (p, p).

    Where Z is minus the gradient of a smooth criterion at M, M solves that problem up to its length, and by
    homogeneity the answer is ``cost(M) <Z, M>^degree``. Otherwise a convex program of size p answers; that is a
    solver's word, and it is lowered by a safe multiple of its tolerance (0 where it gives none).
    """
    import cvxpy as cp

    cost, T = float(criterion.cost(M)), whitener(M)
    S = np.linalg.inv(T)
    Y = S @ Z @ S.T
    if (size := float(np.trace(Y))) <= 0:
        return 0.0
    if criterion.smooth:
        G = S @ criterion.gradient(M) @ S.T
        if np.abs(Y / size - G / np.trace(G)).max() <= 1e-12:
            return float(cost * size**criterion.degree)
    X = cp.Variable(Z.shape, PSD=True)
    expression = criterion.expression(X, T * cost ** (-0.5 / criterion.degree))
    program = cp.Problem(cp.Minimize(expression), [cp.trace(Y / size @ X) <= 1])
    for tolerance in (1e-10, 1e-9, 1e-8):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of inaccuracy
                program.solve(
                    solver="CLARABEL",
                    tol_gap_rel=tolerance,
                    tol_gap_abs=tolerance,
                    tol_feas=tolerance,
                )
        except cp.SolverError:
            continue
        if program.status == cp.OPTIMAL:
            break
    else:
        return 0.0
    value = (1 - 1e-7) * float(program.value)
    return float(cost * value ** (1.0 / criterion.expression_power) * size**criterion.degree)


def _at(criterion: "Criterion", M: Array) -> tuple["cp.Expression", "cp.Variable"]:
    """The expression with its argument set to M, and that argument."""
    import cvxpy as cp

    X = cp.Variable(M.shape)
    X.value = M
    return criterion.expression(X), X
