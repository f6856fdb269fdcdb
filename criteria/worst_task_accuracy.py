"""rho_max: accuracy of the compliance compensation in the worst of several tasks."""

from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import KinkedCriterion
from criteria.linalg.inverse import (
    TINY,
    lowered_root,
    power_trace_of_root,
    rounding_of_rows,
    whitener,
)
from criteria.linalg.logarithms import soft_maximum
from criteria.linalg.long_product import long_product
from criteria.linalg.shares import least_squares_shares, steps_to_largest_polar
from criteria.linalg.typing import Array, Indices, triangle
from criteria.registry import register
from criteria.relaxable import Formulation

if TYPE_CHECKING:
    import cvxpy as cp


@register
class WorstTaskAccuracy(KinkedCriterion, ConvexCriterion):
    """``rho_max = max_i sqrt(trace(A_i cov A_i'))`` [m], the largest rho0 of several tasks.

    With ``L_i = A_i' A_i`` and the errors ``r_i = sqrt(<L_i, cov>)`` the cost is
    ``(sum r_i^s)^(1/s)`` with sharpness s. A subgradient is that of a task i whose error is the
    largest, ``-cov L_i cov / (2 r_i)``. Tasks that are given twice count once.

    Args:
        targets: The regressors A_i of the tasks (tasks, rows, p), or (rows, p) of a single one,
            finite and not all zero [m/(rad/(N m))].
        sharpness: Exponent of the soft maximum, above one; inf for the maximum itself.

    Raises:
        ValueError: The targets are not such matrices.
    """

    name = "rho_max"
    title = "Worst task accuracy"
    formula = "max_i sqrt(trace(A_i cov A_i'))"
    sense = "min"
    degree = 0.5
    unit_free = True
    needs_target = True
    per_task = True
    shown = (1e3, "mm")
    expression_power = 2.0

    def __init__(self, targets: ArrayLike, sharpness: float = np.inf) -> None:
        super().__init__(sharpness)
        # A frozen copy: a later change of the caller's array must not change the criterion.
        found = np.array(targets, dtype=float)
        self.targets = found[None] if found.ndim == 2 else found
        if self.targets.ndim != 3 or not np.isfinite(found).all() or not found.any():
            raise ValueError(
                "rho_max: the targets must be finite matrices (tasks, rows, p), not all zero"
            )
        self.targets.flags.writeable = False

    @property
    def arguments(self) -> dict[str, Any]:
        """The targets."""
        return {"targets": self.targets.tolist()}

    @property
    def order(self) -> int:
        """Number of columns of the targets."""
        return int(self.targets.shape[2])

    def smoothed(self, sharpness: float) -> Self:
        """The same criterion with a soft maximum in place of the maximum."""
        return type(self)(self.targets, sharpness)

    def in_units(self, T: Array) -> Self:
        """The targets become ``A_i T``."""
        return type(self)(long_product(self.targets, T).astype(float), self.sharpness)

    def transformed(self, T: Array) -> Self:
        """The same target says the same of other parameters."""
        return self.in_units(T)

    def rounding(self, W: Array) -> float:
        """That of the least exact of the tasks."""
        return float(rounding_of_rows(self.targets, W).max())

    def polar(self, Z: Array, M: Array) -> float:
        """``trace (B Z B')^(1/2)``, ``B'B = sum l_i L_i``, for weights l of the tasks of sum one.

        Any l is valid: the worst task is at least as bad as any weighted mean of squares, which is
        rho0 with the target B; see `dual_weights` for the choice.
        """
        return _weighted_polar(self.targets, lowered_root(Z), self.dual_weights(Z, M))

    def dual_weights(self, Z: Array, M: Array) -> Array:
        """Weights l (tasks,) of sum one with which a multiplier proves much, see `polar`.

        At the optimum ``M Z M = c sum l_i L_i``, with weights on tasks of the largest error alone.
        Non-negative least squares solve that in the parameters that whiten M, with the distance of
        each error from the largest as a penalty. The steps ``l_i ~ l_i <L_i, G>``, with G the
        gradient of the polar by ``B'B``, never make it worse. The second choice is all weight on
        the worst task.

        Args:
            Z: Symmetric positive semidefinite multiplier (p, p).
            M: A regular design (p, p), near which the bound shall be tight.
        """
        tasks, squares = self._distinct
        T = whitener(M)
        # M = S'S and cov = T T', so that no unit of a parameter costs digits.
        S = np.linalg.inv(T)
        whitened = T.T @ squares @ T
        worst = np.trace(whitened, axis1=1, axis2=2).argmax()
        F = lowered_root(Z)
        starts = [
            _least_squares_weights(whitened, S @ Z @ S.T),
            (np.arange(len(tasks)) == worst).astype(float),
        ]
        best = starts[1]
        most = -1.0
        for weights in starts:
            for step in steps_to_largest_polar(whitened, S @ Z @ S.T, weights):
                found = _weighted_polar(self.targets[tasks], F, step)
                if found > most:
                    most = found
                    best = step
        spread = np.zeros(len(self.targets))
        spread[tasks] = best
        return spread

    def variance_rows(self, p: int) -> Array | None:
        """The targets of the tasks that differ, unless it is smoothed."""
        return None if self.smooth else self.targets[self._distinct[0]]

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """``min max_i <T' L_i T, C> / unit^2`` over ``[[C, I], [I, M]] >= 0``, or ``C >= M^-1``.

        One matrix C serves all tasks: each of them adds a linear inequality, and no cone.
        """
        import cvxpy as cp

        p = len(T)
        _, squares = self._distinct
        rows, columns = triangle(p)
        # An entry beside the diagonal stands once in the triangle, but twice in <L, C>.
        twice = np.where(rows == columns, 1.0, 2.0)
        packed = (T.T @ squares @ T)[:, rows, columns] * twice / unit**2
        C = cp.Variable((p, p), symmetric=True)
        inverse = cp.bmat([[C, np.eye(p)], [np.eye(p), M]])
        errors = packed @ cp.vec(C, order="C")[rows * p + columns]
        return cp.max(errors), [inverse >> 0, total == 1]

    @cached_property
    def _distinct(self) -> tuple[Indices, Array]:
        """Indices (d,) of tasks that differ and matter, and their L_i (d, p, p), in a fixed order.

        A task that is given twice so changes no bit of a cost, nor does the order of the tasks.
        """
        squares = np.swapaxes(self.targets, 1, 2) @ self.targets
        _, tasks = np.unique(squares.reshape(len(squares), -1), axis=0, return_index=True)
        tasks = tasks[squares[tasks].any(axis=(1, 2))]
        return tasks, squares[tasks]

    def _errors(self, cov: Array) -> Array:
        """Errors r_i (..., d) of the tasks that differ."""
        _, squares = self._distinct
        p = cov.shape[-1]
        found = cov.reshape(-1, p * p) @ squares.reshape(-1, p * p).T
        return np.sqrt(np.maximum(found, TINY)).reshape(*cov.shape[:-2], len(squares))

    def _cost(self, M: Array, cov: Array) -> Array:
        return soft_maximum(self._errors(cov), self.sharpness)[0]

    def _gradient(self, M: Array, cov: Array) -> Array:
        _, squares = self._distinct
        errors = self._errors(cov)
        _, slopes = soft_maximum(errors, self.sharpness)
        mixed = np.tensordot(slopes / (2 * errors), squares, axes=1)
        return -cov @ mixed @ cov


def _weighted_polar(targets: Array, F: Array, weights: Array) -> float:
    """The polar of rho0 with the rows ``sqrt(l_i) A_i`` of targets (t, rows, p) as its target.

    It is computed from a root F (p, p) of the multiplier ``F'F``: of a product that has no part in
    some direction, rounding would leave an eigenvalue, and its root would be far larger.
    """
    carries = weights > 0
    if not carries.any():
        return 0.0  # no weights, no proof
    rows = np.sqrt(weights[carries])[:, None, None] * targets[carries]
    # At most p rows have the same squares; the factor comes from the rows, not from their squares.
    B = np.asarray(np.linalg.qr(rows.reshape(-1, rows.shape[-1]), mode="r"))
    return power_trace_of_root(B @ F.T, 0.5)


def _least_squares_weights(squares: Array, Z: Array) -> Array:
    """Weights (d,) of sum one with ``sum l_i L_i`` nearly proportional to Z, all whitened."""
    sizes = np.trace(squares, axis1=1, axis2=2)
    largest = sizes.max()
    # Without the penalty a task below the largest error may stand in for some that have it.
    return least_squares_shares(squares, Z, 1 - sizes / largest, largest)
