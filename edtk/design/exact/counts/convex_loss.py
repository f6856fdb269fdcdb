"""Convex losses of a plan with tangents, and their values after an exchange of several rows."""

from abc import ABC, abstractmethod

import numpy as np

from criteria import Criterion
from criteria.criterion import DeterminantCriterion
from edtk.design.exact.exchange_costs import UPDATABLE, constant_slope, exchange_costs
from edtk.system.typing import Array


class ConvexLoss(ABC):
    """A convex function f of the information M of which a criterion's cost is a rising function.

    A tangent at any information X bounds it from below: ``f(M) >= f(X) - <Z, M - X>`` with
    ``Z = -f'(X)``. Values after an exchange come from the covariance of the other experiments.

    Attributes:
        criterion: The criterion.
    """

    criterion: Criterion

    @abstractmethod
    def tangent(self, M: Array) -> tuple[float, Array]:
        """``f(M)`` and ``Z = -f'(M)`` (p, p) at a regular M (p, p)."""

    @abstractmethod
    def cost(self, values: Array) -> Array:
        """The criterion's costs (k,) for values of f (k,)."""

    @abstractmethod
    def joined(self, cov: Array, U: Array) -> Array:
        """Values (k,) of f where rows (k, r, p) join experiments of covariance (p, p)."""

    def joined_costs(self, rest: Array, U: Array) -> Array:
        """Costs (k,) where rows (k, r, p) join experiments of information (p, p).

        Where the rest is nearly singular, each sum is formed and inverted itself.
        """
        cov = _accurate_inverse(rest)
        if cov is not None:
            return self.cost(self.joined(cov, U))
        costs = exchange_costs(self.criterion, rest[None], U[None], np.ones(1))[0]
        return np.where(np.isnan(costs), np.inf, costs)


class DeterminantLoss(ConvexLoss):
    """``-log det M``, of which Z is the covariance."""

    criterion: DeterminantCriterion

    def __init__(self, criterion: DeterminantCriterion, p: int) -> None:
        self.criterion = criterion
        self.p = p

    def tangent(self, M: Array) -> tuple[float, Array]:
        """Minus the logarithm of the determinant, and the covariance."""
        return -float(np.linalg.slogdet(M).logabsdet), np.asarray(np.linalg.inv(M))

    def cost(self, values: Array) -> Array:
        """The criterion's costs."""
        return self.criterion.cost_of_log_determinant(-values, self.p)

    def joined(self, cov: Array, U: Array) -> Array:
        """``log det C - log det(I + U C U')``."""
        _, S = _products(cov, U)
        own = np.linalg.slogdet(cov).logabsdet
        return np.asarray(own - np.linalg.slogdet(S).logabsdet)


class TraceLoss(ConvexLoss):
    """``tr(W C)/tr W`` of the covariance C, with ``Z = C W C/tr W``.

    Args:
        criterion: A criterion whose cost is a power of ``tr(W C)``, the degree.
        W: Symmetric positive semidefinite matrix (p, p).
    """

    def __init__(self, criterion: Criterion, W: Array) -> None:
        self.criterion = criterion
        # Variances in SI units may be too small for numbers of single precision.
        self.unit = float(np.trace(W))
        self.W = W / self.unit

    def tangent(self, M: Array) -> tuple[float, Array]:
        """The trace, and minus its slope."""
        cov = np.asarray(np.linalg.inv(M), dtype=float)
        told = self.W @ cov
        return float(np.trace(told)), cov @ told

    def cost(self, values: Array) -> Array:
        """The power of the trace; rounding below zero is no plan."""
        positive = np.where(values > 0, values, np.inf)
        return np.asarray((self.unit * positive) ** self.criterion.degree)

    def joined(self, cov: Array, U: Array) -> Array:
        """That of C less ``tr((I + U C U')^-1 U C W C U')/tr W``."""
        UC, S = _products(cov, U)
        k, r, p = U.shape
        told = (UC.reshape(-1, p) @ self.W).reshape(k, r, p) @ np.swapaxes(UC, 1, 2)
        fall = np.trace(np.linalg.solve(S, told), axis1=1, axis2=2)
        return np.asarray(float(np.sum(self.W * cov)) - fall)


def convex_loss(criterion: Criterion, mean: Array) -> ConvexLoss | None:
    """The loss of a criterion; None where it is neither of the determinant nor of a trace.

    Args:
        criterion: The criterion.
        mean: A regular information matrix (p, p).
    """
    if not criterion.convex:
        return None
    if isinstance(criterion, DeterminantCriterion):
        return DeterminantLoss(criterion, len(mean))
    slope = constant_slope(criterion, mean)
    return None if slope is None else TraceLoss(criterion, slope)


def _products(cov: Array, U: Array) -> tuple[Array, Array]:
    """``U C`` (k, r, p) and ``I + U C U'`` (k, r, r)."""
    k, r, p = U.shape
    UC = (U.reshape(-1, p) @ cov).reshape(k, r, p)
    return UC, UC @ np.swapaxes(U, 1, 2) + np.eye(r)


def _accurate_inverse(rest: Array) -> Array | None:
    """The inverse of a symmetric matrix (p, p); None where an update of it could be noise.

    The least eigenvalue at unit diagonal is at least one over the norm of the inverse, which
    takes a fraction of the time of eigenvalues.
    """
    diagonal = np.diag(rest)
    if not (diagonal > 0).all():
        return None
    d = np.sqrt(diagonal)
    dd = np.outer(d, d)
    try:
        inverse = np.linalg.inv(rest / dd)
    except np.linalg.LinAlgError:
        return None
    size = float(np.linalg.norm(inverse))
    # Of an indefinite matrix, which rounding may have left, the inverse has a negative entry here.
    positive = bool((np.diag(inverse) > 0).all())
    return inverse / dd if positive and size * UPDATABLE < 1.0 else None
