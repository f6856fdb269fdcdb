"""The restricted master problem of a criterion of extreme eigenvalues."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from criteria.linalg.inverse import whitener
from criteria.linalg.typing import isometric, triangle
from criteria.relaxable import SpectralBand
from edtk.design.relaxation.master_equations import (
    SPREAD,
    ActiveInformation,
    ConicSolve,
    PathPoint,
    conic_equations,
    definite_duals,
    nearest_point,
    step_length,
)
from edtk.system.typing import Array

INSIDE = 2.0  # how far inside its constraints the first point lies
# Part of a point well inside that a start from an earlier answer keeps: that answer may be exact,
# and lies on the boundary then.
INWARD = 1e-10
LIFT = 1e-9  # part of itself by which a multiplier is lifted if its parts could not be told apart


@dataclass(frozen=True, eq=False)
class Scaling:
    """Parameters in which each inequality X (c, p, p) and its dual S are the same.

    Attributes:
        H: ``H X H' = H^-T S H^-1 = diag(l)`` (c, p, p).
        l: The diagonals (c, p).
    """

    H: Array
    l: Array  # noqa: E741, the letter of the formula

    @classmethod
    def of(cls, X: Array, S: Array) -> "Scaling":
        """The scaling of Nesterov and Todd, by the singular values of a product of factors."""
        L, K = np.linalg.cholesky(np.stack([X, S]))
        _, l, rows = np.linalg.svd(np.swapaxes(K, 1, 2) @ L)  # noqa: E741
        turned = np.swapaxes(rows, 1, 2) * np.sqrt(l)[:, None]
        return cls(np.swapaxes(np.linalg.solve(np.swapaxes(L, 1, 2), turned), 1, 2), l)

    def change(self, mu: float, lost: Array) -> Array:
        """C (c, p, p) with ``(diag(l) C + C diag(l))/2 = mu I - diag(l)^2 - lost``."""
        right = -lost
        each = np.arange(self.l.shape[1])
        right[:, each, each] += mu - self.l**2
        return 2.0 * right / (self.l[:, :, None] + self.l[:, None])

    def lengths(self, X: Array, S: Array) -> tuple[float, float]:
        """How far steps along X and S (c, p, p) may go, in these parameters.

        Args:
            X: Changes of the inequalities.
            S: Changes of their duals.
        """
        root = np.sqrt(self.l)
        both = np.stack([X, S]) / (root[:, :, None] * root[:, None])
        least = np.linalg.eigvalsh(both)[..., 0]
        one = np.ones(len(X))
        return step_length(one, least[0]), step_length(one, least[1])


@dataclass(frozen=True, eq=False)
class SpectralDirection:
    """Changes of weights, the upper bound, slacks, and the inequalities and their duals.

    Attributes:
        w: Changes of the weights (k,).
        kappa: Change of the upper bound.
        v: Changes of the slacks (k,).
        X: Changes of the inequalities (c, p, p), in the scaled parameters.
        S: Changes of their duals (c, p, p), likewise.
    """

    w: Array
    kappa: float
    v: Array
    X: Array
    S: Array


def spectral_weights(
    band: SpectralBand,
    active: ActiveInformation,
    start: Array,
    accuracy: float,
    near: Array | None = None,
) -> tuple[Array, Array]:
    """Minimise ``b sum(w) + a kappa`` over ``w >= 0`` with ``F <= M(w), R'M(w) R <= kappa I``.

    This is a semidefinite program, solved by a primal-dual interior point method in the directions
    of Nesterov and Todd, with Mehrotra's predictor and corrector (Todd, Toh and Tutuncu, SIAM J.
    Optim. 8, 1998). Y and Z, both positive semidefinite, are the duals of the two inequalities:
    ``<Y - R Z R', M_i> + v_i = b`` with slacks v, and ``trace(Z) = a``. In the parameters in which
    an inequality and its dual are the same diagonal matrix, the equations of a step have the form
    of those of D-optimality.

    Args:
        band: The numbers a and b, and the matrices F and R.
        active: Information of the candidates (k).
        start: Weights (k,) to start near.
        accuracy: Relative gap at which to end.
        near: The multiplier (p, p) of a like program, of which the weights to start near are.

    Returns:
        Weights (k,), positive, of sum one, and the multiplier ``Y - R Z R'`` (p, p).

    Raises:
        LinAlgError: The first weights leave a direction open.
    """
    T = whitener(active.information(start))
    band = band.transformed(T)
    point = _Point.first(band, active, T, start)
    if near is not None:
        point = point.towards(start, near)
    best = nearest_point(point, accuracy)
    Z = best.multiplier
    if band.is_graded:
        # A proof takes both parts from the multiplier. The small one is far below the rounding of
        # the other; lifted by more than that, what is left for it is clear.
        Z = Z + LIFT * np.linalg.norm(Z, 2) * np.eye(len(Z))
    Z = T @ Z @ T.T
    return best.w / best.w.sum(), 0.5 * (Z + Z.T)


def _largest_multiple(allowed: Array, used: Array) -> float:
    """The largest multiple of what is used (k,) that exceeds nothing of what is allowed (k,).

    Candidates that tell nothing use nothing, and limit nothing.
    """
    with np.errstate(over="ignore"):
        return float((allowed / np.maximum(used, np.finfo(float).tiny)).min())


@dataclass(frozen=True, eq=False)
class _Point(PathPoint[SpectralDirection]):
    """A point inside all constraints, in the parameters that T whitens.

    Attributes:
        band: The program in these parameters.
        active: Information of the candidates in the original ones.
        T: The whitener (p, p).
        w: Weights (k,).
        kappa: The upper bound.
        v: Dual slacks (k,).
        duals: Y, and Z where there is an upper bound (c, p, p); Z is in the parameters of R.
    """

    steps: ClassVar[int] = 40
    least_shrinking: ClassVar[float] = 1e-6
    worse: ClassVar[float] = 2.0

    band: SpectralBand
    active: ActiveInformation
    T: Array
    w: Array
    kappa: float
    v: Array
    duals: Array

    @classmethod
    def first(
        cls, band: SpectralBand, active: ActiveInformation, T: Array, start: Array
    ) -> "_Point":
        """A point that satisfies all equations: its duals leave each slack about as large."""
        w = (1 - SPREAD) * start + SPREAD / len(start)
        M = T.T @ active.information(w) @ T
        S = whitener(M)
        size = INSIDE * float(np.linalg.eigvalsh(S.T @ band.floor @ S)[-1])
        R = band.cap
        kappa = INSIDE * size * float(np.linalg.eigvalsh(R.T @ M @ R)[-1])
        Y = S @ S.T
        Z = band.a / len(T) * np.eye(len(T))
        allowed = band.b + active.sensitivities(T @ R @ Z @ R.T @ T.T)
        used = active.sensitivities(T @ Y @ T.T)
        Y *= _largest_multiple(allowed, used) / INSIDE
        v = allowed - active.sensitivities(T @ Y @ T.T)
        duals = np.stack([Y, Z]) if band.a else Y[None]
        return cls(band, active, T, size * w, kappa, v, duals)

    def towards(self, start: Array, near: Array) -> "_Point":
        """The mean of this point and one on the boundary, of the answer to a like program.

        Both satisfy all equations, and so does their mean. The further the answer is from the
        optimum, as its gap tells, the closer the mean is to this point, which is well inside.

        Args:
            start: Weights (k,) of the answer, which T whitens.
            near: Its multiplier (p, p).
        """
        band = self.band
        R = band.cap
        if band.is_graded:
            return self
        size = float(np.linalg.eigvalsh(band.floor)[-1])
        kappa = size * float(np.linalg.eigvalsh(R.T @ R)[-1])
        S = np.linalg.inv(self.T)
        duals = definite_duals(band, S @ near @ S.T)
        allowed = np.full(len(start), band.b)
        if band.a:
            Z = R @ duals[1] @ R.T
            allowed = allowed + self.active.sensitivities(self.T @ Z @ self.T.T)
        used = self.active.sensitivities(self.T @ duals[0] @ self.T.T)
        if not used.max() > 0:
            return self
        most = _largest_multiple(allowed, used)
        duals[0] *= most
        objective = band.b * size + band.a * kappa
        gap = 1 - float(np.vdot(duals[0], band.floor)) / objective
        if not gap < 1:
            return self
        # Rounding may make the gap of an exact answer zero, or negative.
        gap = max(gap, INWARD)

        def mean(own: Array, other: Array) -> Array:
            return gap * own + (1 - gap) * other

        w = mean(self.w, size * start)
        v = mean(self.v, allowed - most * used)
        kappa = gap * self.kappa + (1 - gap) * kappa
        return _Point(band, self.active, self.T, w, kappa, v, mean(self.duals, duals))

    @cached_property
    def inequalities(self) -> Array:
        """``M - F``, and ``kappa I - R'M R`` where there is an upper bound (c, p, p)."""
        M = self.T.T @ self.active.information(self.w) @ self.T
        lower = M - self.band.floor
        if not self.band.a:
            return lower[None]
        R = self.band.cap
        return np.stack([lower, self.kappa * np.eye(len(R)) - R.T @ M @ R])

    @cached_property
    def scaling(self) -> Scaling:
        """The parameters in which the inequalities and their duals are the same."""
        return Scaling.of(self.inequalities, self.duals)

    @property
    def count(self) -> int:
        """Number of products of primal and dual."""
        return len(self.w) + len(self.T) * len(self.duals)

    @property
    def objective(self) -> float:
        """``b sum(w) + a kappa``."""
        return float(self.band.b * self.w.sum() + self.band.a * self.kappa)

    @property
    def multiplier(self) -> Array:
        """``Y - R Z R'`` (p, p)."""
        if not self.band.a:
            return np.asarray(self.duals[0])
        R = self.band.cap
        return np.asarray(self.duals[0] - R @ self.duals[1] @ R.T)

    @cached_property
    def residuals(self) -> tuple[Array, float]:
        """What is missing (k,) in the equations of the slacks, and in ``trace(Z) = a``."""
        found = self.active.sensitivities(self.T @ self.multiplier @ self.T.T)
        upper = self.band.a - np.trace(self.duals[-1]) if self.band.a else 0.0
        return self.band.b - found - self.v, float(upper)

    @cached_property
    def mu(self) -> float:
        """Mean product of primal and dual."""
        products = self.w @ self.v + np.vdot(self.inequalities, self.duals)
        return float(products) / self.count

    @cached_property
    def error(self) -> float:
        """Relative gap of primal and dual, and what their equations miss."""
        missing, upper = self.residuals
        lost = float(np.abs(missing).max() * self.w.sum()) + abs(upper) * self.kappa
        return max(self.mu * self.count, lost) / self.objective

    def lengths(self, along: SpectralDirection) -> tuple[float, float]:
        """How far primal and dual may go, from weights, slacks and inequalities inside."""
        primal, dual = self.scaling.lengths(along.X, along.S)
        return min(step_length(self.w, along.w), primal), min(step_length(self.v, along.v), dual)

    def products_after(self, along: SpectralDirection, primal: float, dual: float) -> float:
        """Of weights and slacks, and of inequalities and their duals, which are the same here."""
        reached = (self.w + primal * along.w) @ (self.v + dual * along.v)
        each = np.arange(len(self.T))
        X = primal * along.X
        S = dual * along.S
        X[:, each, each] += self.scaling.l
        S[:, each, each] += self.scaling.l
        return float(reached + np.vdot(X, S))

    def moved(self, along: SpectralDirection, primal: float, dual: float) -> "_Point":
        """The point at the end of a step, all of which are inside."""
        H = self.scaling.H
        change = np.swapaxes(H, 1, 2) @ along.S @ H
        duals = self.duals + 0.5 * dual * (change + np.swapaxes(change, 1, 2))
        w = self.w + primal * along.w
        kappa = self.kappa + primal * along.kappa
        v = self.v + dual * along.v
        return _Point(self.band, self.active, self.T, w, kappa, v, duals)

    def directions(self) -> "Callable[[float, SpectralDirection | None], SpectralDirection]":
        """From products and the predictor to a direction."""
        return self._equations().direction

    def _equations(self) -> "_Equations":
        """The equations of a step, factorized."""
        rows, columns = triangle(len(self.T))
        scale = isometric(len(self.T))
        H = self.scaling.H
        lower = self.active.triangles(self.T @ H[0].T, scale)
        D = self.v / self.w
        if not self.band.a:
            return _Equations(self, lower, None, conic_equations(lower, D, None))
        ceiling = (H[1] @ H[1].T)[rows, columns] * scale
        last = np.concatenate([np.zeros(len(rows)), ceiling])
        upper = self.active.triangles(self.T @ self.band.cap @ H[1].T, -scale)
        P = np.vstack([lower, upper])
        return _Equations(self, P, last, conic_equations(P, D, last))


@dataclass(frozen=True, eq=False)
class _Equations:
    """The equations of a step from a point, for several right-hand sides.

    Attributes:
        point: The point.
        P: Changes (q, k) of the scaled triangles of all inequalities by each weight.
        last: Their change (q,) by kappa, if there is an upper bound.
        solve: Solves the equations.
    """

    point: _Point
    P: Array
    last: Array | None
    solve: ConicSolve

    def direction(self, mu: float, predictor: SpectralDirection | None) -> SpectralDirection:
        """The direction to the products mu, less those of the predictor's changes."""
        point = self.point
        lost = np.zeros_like(point.w)
        lost_in_cones = np.zeros_like(point.duals)
        if predictor is not None:
            lost = predictor.w * predictor.v
            changes = predictor.X @ predictor.S
            lost_in_cones = 0.5 * (changes + np.swapaxes(changes, 1, 2))
        rows, columns = triangle(len(point.T))
        scale = isometric(len(point.T))
        wanted = point.scaling.change(mu, lost_in_cones)[:, rows, columns] * scale
        missing, upper = point.residuals
        products = mu - point.w * point.v - lost
        dw, kappa, y = self.solve(wanted.ravel(), products / point.w - missing, upper)
        change = self.P @ dw if self.last is None else self.P @ dw + kappa * self.last
        both = np.empty((2, *point.duals.shape))
        packed = np.stack([change, y]).reshape(2, len(point.duals), -1) / scale
        both[..., rows, columns] = packed
        both[..., columns, rows] = packed
        dv = (products - point.v * dw) / point.w
        return SpectralDirection(dw, kappa, dv, both[0], both[1])
