"""The restricted master problem of a criterion that is the largest of several variances."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from criteria.linalg.inverse import eigenpairs, whitener
from criteria.linalg.typing import isometric, triangle
from edtk.design.relaxation.loss_weights import FIRST_OF_LIMIT
from edtk.design.relaxation.master_equations import (
    SPREAD,
    ActiveInformation,
    PathPoint,
    Solve,
    nearest_point,
    step_length,
    weight_equations,
)
from edtk.design.relaxation.newton_weights import ASTRAY
from edtk.design.relaxation.proof import rounding_of_inverse
from edtk.design.relaxation.spectral_weights import INWARD
from edtk.system.typing import Array

LEFT_BY_STEP = 0.01  # part of the distance from the largest variance that a step must leave


def variance_weights(
    rows: Array,
    active: ActiveInformation,
    start: Array,
    accuracy: float,
    near: Array | None = None,
) -> tuple[Array, Array]:
    """Minimise ``sum(w)`` over ``w >= 0`` with ``v_j(w) = trace(A_j cov A_j') <= 1`` for all j.

    A largest variance is homogeneous, so that its best design is the one that needs the least
    weight to keep all variances below one. They are convex functions of w. A primal-dual interior
    point method with Mehrotra's predictor and corrector follows the optimality conditions

        1 - <Z, M_i> = s_i,   Z = cov L cov,   L = sum_j u_j A_j' A_j,   w_i s_i = u_j c_j = mu

    with slacks s and ``c_j = 1 - v_j`` to mu near zero (Boyd and Vandenberghe, Convex Optimization,
    section 11.7). With L diagonal in parameters that whiten M, the second derivative of
    ``sum u_j v_j`` has no mixed terms, see `criteria.curvature`.

    Args:
        rows: A_j (j, r, p).
        active: Information of the candidates (k).
        start: Weights (k,) to start near.
        accuracy: Relative gap at which to end.
        near: The multiplier (p, p) of a like program, of which the weights to start near are.

    Returns:
        Weights (k,), positive, of sum one, and the multiplier Z (p, p).

    Raises:
        LinAlgError: The first weights leave a direction open.
    """
    point = _Point.first(rows, active, start)
    if near is not None:
        point = point.towards(start, near)
    best = nearest_point(point, accuracy)
    return best.w / best.w.sum(), best.multiplier


@dataclass(frozen=True, eq=False)
class _Direction:
    """Changes of weights and slacks (k,), of duals and of variances (j,), these to first order."""

    w: Array
    s: Array
    u: Array
    variances: Array


@dataclass(frozen=True, eq=False)
class _Point(PathPoint[_Direction]):
    """Weights, duals, and what follows from them.

    Attributes:
        rows: A_j (j, r, p).
        active: Information of the candidates.
        w: Weights (k,), positive.
        s: Their slacks (k,), positive.
        u: Duals of the variances (j,), positive.
    """

    rows: Array
    active: ActiveInformation
    w: Array
    s: Array
    u: Array

    @classmethod
    def first(cls, rows: Array, active: ActiveInformation, start: Array) -> "_Point":
        """A point that satisfies all equations: its duals leave each slack about as large."""
        w = (1 - SPREAD) * start + SPREAD / len(start)
        point = cls(rows, active, w, w, np.ones(len(rows)))
        scale = float(point.variances.max()) / FIRST_OF_LIMIT
        point = cls(rows, active, scale * w, w, np.ones(len(rows)))
        u = 1.0 / point.c
        point = cls(rows, active, point.w, w, u)
        used = active.sensitivities(point.multiplier)
        u *= FIRST_OF_LIMIT / used.max()
        return cls(rows, active, point.w, 1.0 - FIRST_OF_LIMIT / used.max() * used, u)

    def towards(self, start: Array, near: Array) -> "_Point":
        """The mean of this point and the answer to a like program.

        The further the answer is from the optimum, as its gap tells, the closer the mean is to this
        point, which is well inside.

        Args:
            start: Weights (k,) of the answer.
            near: Its multiplier (p, p).
        """
        size = float(_Point(self.rows, self.active, start, self.s, self.u).variances.max())
        u = _duals_of(self.rows, size * self.active.information(start), near)
        answer = _Point(self.rows, self.active, size * start, self.s, u)
        used = self.active.sensitivities(answer.multiplier)
        most = float(used.max())
        gap = 1 - float(used @ start) / most if most > 0 else 1.0
        if not gap < 1:
            return self
        # Rounding may make the gap of an exact answer zero, or negative.
        gap = max(gap, INWARD)

        def mean(own: Array, other: Array) -> Array:
            return gap * own + (1 - gap) * other

        return _Point(
            self.rows,
            self.active,
            mean(self.w, answer.w),
            mean(self.s, 1.0 - used / most),
            mean(self.u, u / most),
        )

    @cached_property
    def T(self) -> Array:
        """Whitener (p, p) of the design."""
        return whitener(self.active.information(self.w))

    @cached_property
    def turned(self) -> Array:
        """``A_j T`` (j, r, p), whose squares are the variances."""
        return self.rows @ self.T

    @cached_property
    def variances(self) -> Array:
        """v_j (j,)."""
        return np.einsum("jri,jri->j", self.turned, self.turned)

    @property
    def c(self) -> Array:
        """How far the variances (j,) are below one."""
        return 1.0 - self.variances

    @cached_property
    def spectrum(self) -> tuple[Array, Array]:
        """Eigenvalues l (p,) and eigenvectors V (p, p) of ``T' L T``."""
        rows = np.sqrt(self.u)[:, None, None] * self.turned
        flat = rows.reshape(-1, rows.shape[-1])
        l, V = eigenpairs(flat.T @ flat)  # noqa: E741, the letter of the formula
        return np.maximum(l, 0.0), V

    @cached_property
    def multiplier(self) -> Array:
        """Z (p, p)."""
        l, V = self.spectrum  # noqa: E741
        root = self.T @ V * np.sqrt(l)
        return root @ root.T

    @cached_property
    def missing(self) -> Array:
        """What is missing (k,) in ``1 - <Z, M_i> = s_i``."""
        return 1.0 - self.active.sensitivities(self.multiplier) - self.s

    @property
    def count(self) -> int:
        """Number of products of primal and dual."""
        return len(self.w) + len(self.u)

    @property
    def mu(self) -> float:
        """Mean product of primal and dual."""
        return float(self.w @ self.s + self.u @ self.c) / self.count

    @cached_property
    def error(self) -> float:
        """The gap, what the equations miss, or what rounding makes of variances.

        Near a singular optimum the information about the direction that it leaves open shrinks with
        the gap, and rounding grows: a point further along the path proves less.
        """
        M = self.active.information(self.w)
        rounding = rounding_of_inverse(M, np.square(self.T).sum(axis=1))
        return max(self.gap, float(np.abs(self.missing).max()), rounding)

    @property
    def gap(self) -> float:
        """Relative gap of primal and dual."""
        return float(self.mu * self.count / self.w.sum())

    @property
    def is_astray(self) -> bool:
        """Whether slacks are far from the slopes."""
        return bool(np.abs(self.missing).max() > ASTRAY * self.gap)

    def directions(self) -> Callable[[float, _Direction | None], _Direction]:
        """From products and the predictor to changes of weights, slacks and duals."""
        solve, J = self._equations()

        def direction(mu: float, predictor: _Direction | None) -> _Direction:
            lost = np.zeros_like(self.w)
            lost_of_variances = np.zeros_like(self.u)
            if predictor is not None:
                lost = predictor.w * predictor.s
                lost_of_variances = -predictor.variances * predictor.u
            products = mu - self.w * self.s - lost
            of_variances = (mu - self.c * self.u - lost_of_variances) / self.c
            dw = solve(products / self.w - self.missing - J.T @ of_variances)
            along = J @ dw
            ds = (products - self.s * dw) / self.w
            return _Direction(dw, ds, of_variances + self.u / self.c * along, along)

        return direction

    def lengths(self, along: _Direction) -> tuple[float, float]:
        """How far primal and dual may go."""
        primal = min(step_length(self.w, along.w), step_length(self.c, -along.variances))
        return primal, min(step_length(self.s, along.s), step_length(self.u, along.u))

    def products_after(self, along: _Direction, primal: float, dual: float) -> float:
        """Of weights and slacks, and of what variances leave and their duals."""
        c = self.c - primal * along.variances
        reached = (self.w + primal * along.w) @ (self.s + dual * along.s)
        return float(reached + np.maximum(c, 0.0) @ (self.u + dual * along.u))

    def moved(self, along: _Direction, primal: float, dual: float) -> "_Point | None":
        """The point there; the variances are convex, and fall less than their slopes say."""
        w = self.w + primal * along.w
        s = self.s + dual * along.s
        found = _Point(self.rows, self.active, w, s, self.u + dual * along.u)
        return found if (found.c > LEFT_BY_STEP * self.c).all() else None

    def _equations(self) -> tuple[Solve, Array]:
        """The equations of a step, and the slopes J (j, k) of the variances."""
        l, V = self.spectrum  # noqa: E741
        rows, columns = triangle(len(V))
        twice = isometric(len(V))
        E = self.active.triangles(self.T @ V, twice)
        B = self.turned @ V
        squares = np.swapaxes(B, 1, 2) @ B
        J = -(squares[:, rows, columns] * twice) @ E
        curved = np.sqrt(l[rows] + l[columns])[:, None] * E
        P = np.vstack([curved, np.sqrt(self.u / self.c)[:, None] * J])
        return weight_equations(P, self.s / self.w, most=np.inf), J


def _duals_of(rows: Array, M: Array, Z: Array) -> Array:
    """Duals u (j,) with ``sum_j u_j A_j' A_j = M Z M``, as nearly as they are positive."""
    T = whitener(M)
    S = np.linalg.inv(T)
    turned = rows @ T
    squares = np.swapaxes(turned, 1, 2) @ turned
    L = S @ Z @ S.T
    return np.maximum(np.linalg.lstsq(squares.reshape(len(rows), -1).T, L.ravel())[0], 0.0)
