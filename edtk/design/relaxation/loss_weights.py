"""The restricted master problem of a criterion that is the largest of several smooth losses."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from criteria.linalg.inverse import eigenpairs, whitener
from criteria.linalg.typing import triangle
from criteria.relaxable import Losses
from edtk.design.relaxation.master_equations import (
    SPREAD,
    ActiveInformation,
    PathPoint,
    Solve,
    nearest_point,
    step_length,
    weight_equations,
)
from edtk.system.interruptible import interruptible
from edtk.system.time_limit import time_of_program
from edtk.system.typing import Array

ABOVE = 0.5  # how far the first t is above the largest loss
FIRST_OF_LIMIT = 0.5  # the largest sensitivity at the first point, where one is allowed
HALVINGS = 40  # of an interval for t; what remains of it is nothing beside the interval
# Slacks further than so many gaps from the slopes are brought back to them before the next step.
ASTRAY_OF_LOSSES = 1.0
SOLVER_TOLERANCE = 1e-10  # tolerances of a linear program, the least that its solver takes


def loss_weights(
    losses: Losses, active: ActiveInformation, start: Array, accuracy: float
) -> tuple[Array, Array]:
    """Minimise the largest of losses ``f_j(M(w))`` over weights of sum one.

    As the losses are of degree one, that is to minimise t over ``w >= 0`` and t with
    ``h_j(w) = log f_j(M(w)) + sum(w) <= t``; the sum then is one by itself. All h_j are convex. A
    primal-dual interior point method with Mehrotra's predictor and corrector follows the optimality
    conditions

        1 - <Z, M_i> = s_i,   Z = sum_j u_j G_j,   sum_j u_j = 1,   w_i s_i = u_j c_j = mu

    with ``G_j = -grad log f_j``, slacks s and ``c_j = t - h_j``, to mu near zero (Boyd and
    Vandenberghe, Convex Optimization, section 11.7).

    Args:
        losses: Losses with a curvature in closed form (j).
        active: Information of the candidates (k).
        start: Weights (k,) to start near.
        accuracy: Relative gap at which to end.

    Returns:
        Weights (k,), positive, of sum one, and the multiplier Z (p, p).

    Raises:
        LinAlgError: The first weights leave a direction open.
    """
    if losses.models is not None and losses.models.p == len(losses.models):
        return _of_single_parameters(losses, active, losses.models.p)
    best = nearest_point(_Point.first(losses, active, start), accuracy)
    return best.w / best.w.sum(), np.tensordot(best.u, best.slopes, axes=1)


def _of_single_parameters(losses: Losses, active: ActiveInformation, p: int) -> tuple[Array, Array]:
    """Weights and multiplier where each loss is about a model of one parameter: a linear program.

    A loss of degree one of a number is ``c_j/M_jj``. So the least of all ``M_jj/c_j`` is to be the
    largest, and the multiplier has the duals u of that, ``Z_jj = u_j/(c_j t)``.
    """
    from scipy.optimize import linprog

    logs, _ = losses.logs_and_slopes(np.eye(p))
    told = np.array([active.sensitivities(E) for E in np.eye(p)[:, :, None] * np.eye(p)])
    told = told / np.exp(logs)[:, None]
    unit = told.mean(axis=1).min()
    k = told.shape[1]
    options = {
        "primal_feasibility_tolerance": SOLVER_TOLERANCE,
        "dual_feasibility_tolerance": SOLVER_TOLERANCE,
        "time_limit": time_of_program(),
    }
    found = interruptible(
        lambda: linprog(
            np.append(np.zeros(k), -1.0),
            A_ub=np.column_stack([-told / unit, np.ones(p)]),
            b_ub=np.zeros(p),
            A_eq=np.append(np.ones(k), 0.0)[None],
            b_eq=1.0,
            method="highs-ds",
            options=options,
        )
    )
    if not (found.success and found.x[-1] > 0):
        raise ArithmeticError(found.message)
    duals = -found.ineqlin.marginals / np.exp(logs)
    return found.x[:-1], np.diag(duals / (unit * found.x[-1]))


@dataclass(frozen=True, eq=False)
class _Direction:
    """Changes of weights and slacks (k,), of duals (j,), and of what the losses leave (j,)."""

    w: Array
    s: Array
    u: Array
    c: Array


@dataclass(frozen=True, eq=False)
class _Point(PathPoint[_Direction]):
    """Weights, duals, and what follows from them.

    Attributes:
        losses: The losses (j).
        active: Information of the candidates.
        w: Weights (k,), positive.
        room: How far t is above the largest h_j, positive.
        s: Slacks (k,) of the weights, positive.
        u: Duals of the losses (j,), positive.
    """

    losses: Losses
    active: ActiveInformation
    w: Array
    room: float
    s: Array
    u: Array

    @classmethod
    def first(cls, losses: Losses, active: ActiveInformation, start: Array) -> "_Point":
        """A point that satisfies all equations, with products ``u_j c_j`` that are the same."""
        w = (1 - SPREAD) * start + SPREAD / len(start)
        point = cls(losses, active, w, ABOVE, w, np.empty(0))
        if not np.isfinite(point.h).all():
            raise np.linalg.LinAlgError("the first weights leave a direction open")
        u = 1.0 / point.c
        u /= u.sum()
        used = 1.0 - u @ point.J
        # Longer weights have smaller slopes, and all h_j then change alike.
        longer = w * used.max() / FIRST_OF_LIMIT
        return cls(losses, active, longer, ABOVE, 1.0 - FIRST_OF_LIMIT * used / used.max(), u)

    @cached_property
    def M(self) -> Array:
        """The design (p, p)."""
        return self.active.information(self.w)

    @cached_property
    def _at_M(self) -> tuple[Array, Array]:
        """Logarithms (j,) and slopes (j, p, p) of the losses."""
        return self.losses.logs_and_slopes(self.M)

    @cached_property
    def h(self) -> Array:
        """h_j (j,)."""
        return self._at_M[0] + self.w.sum()

    @property
    def c(self) -> Array:
        """How far the h_j (j,) are below t."""
        return self.h.max() - self.h + self.room

    @property
    def slopes(self) -> Array:
        """G_j (j, p, p)."""
        return self._at_M[1]

    @cached_property
    def J(self) -> Array:
        """Slopes (j, k) of the h_j by the weights."""
        return 1.0 - np.array([self.active.sensitivities(G) for G in self.slopes])

    @cached_property
    def missing(self) -> Array:
        """What is missing (k,) in ``1 - <Z, M_i> = s_i``."""
        return np.asarray(self.u @ self.J - self.s)

    @property
    def gap(self) -> float:
        """The gap of primal and dual, relative since h is a logarithm."""
        return float(self.w @ self.s + self.u @ self.c)

    @property
    def count(self) -> int:
        """Number of products of primal and dual."""
        return len(self.w) + len(self.u)

    @property
    def mu(self) -> float:
        """Mean product of primal and dual."""
        return self.gap / self.count

    @property
    def is_astray(self) -> bool:
        """Whether slacks are far from the slopes."""
        return bool(np.abs(self.missing).max() > ASTRAY_OF_LOSSES * self.gap)

    @cached_property
    def error(self) -> float:
        """The gap, or what the equations miss."""
        return max(self.gap, float(np.abs(self.missing).max()))

    def moved(self, along: _Direction, primal: float, dual: float) -> "_Point | None":
        """The point there; the h_j are convex, and fall less than their slopes say."""
        w = self.w + primal * along.w
        s = self.s + dual * along.s
        u = self.u + dual * along.u
        found = _Point(self.losses, self.active, w, self.room, s, u / u.sum())
        if found.h.max() > self.h.max() + self.room + self.gap:
            return None
        return replace(found, room=found.central_room(float(w @ s) / len(w)))

    def central_room(self, mu: float) -> float:
        """The room with ``sum_j mu / c_j = 1``, as on the central path, where the duals are so.

        A step along the slopes of the h_j would leave some of them too near to t.
        """
        below = self.h.max() - self.h
        low = mu
        high = mu * len(below)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if (mu / (below + middle)).sum() > 1.0:
                low = middle
            else:
                high = middle
        return high

    def directions(self) -> Callable[[float, _Direction | None], _Direction]:
        """From products and the predictor to changes of weights, slacks and duals.

        With ``q_j = u_j / c_j`` the duals change by ``du = a - q (dt - J dw)``, whose sum is zero.
        """
        solve = self._equations()
        q = self.u / self.c

        def direction(mu: float, predictor: _Direction | None) -> _Direction:
            lost = np.zeros_like(self.w)
            lost_of_losses = np.zeros_like(self.u)
            if predictor is not None:
                lost = predictor.w * predictor.s
                lost_of_losses = predictor.c * predictor.u
            products = mu - self.w * self.s - lost
            a = (mu - self.c * self.u - lost_of_losses) / self.c
            free = a - q * (a.sum() / q.sum())
            dw = solve(products / self.w - self.missing - self.J.T @ free)
            along = self.J @ dw
            dt = float((a.sum() + q @ along) / q.sum())
            ds = (products - self.s * dw) / self.w
            return _Direction(dw, ds, a - q * (dt - along), dt - along)

        return direction

    def lengths(self, along: _Direction) -> tuple[float, float]:
        """How far primal and dual may go."""
        primal = min(step_length(self.w, along.w), step_length(self.c, along.c))
        return primal, min(step_length(self.s, along.s), step_length(self.u, along.u))

    def products_after(self, along: _Direction, primal: float, dual: float) -> float:
        """Of weights and slacks, and of what the losses leave and their duals."""
        reached = (self.w + primal * along.w) @ (self.s + dual * along.s)
        left = np.maximum(self.c + primal * along.c, 0.0)
        return float(reached + left @ (self.u + dual * along.u))

    def _equations(self) -> Solve:
        """The equations of a step: ``sum u_j h_j'' + S/W + J' (Q - q q' / sum q) J``."""
        T = whitener(self.M)
        curvatures = self.losses.loss_curvatures(T)
        assert curvatures is not None  # of losses that this method was asked for
        curved = []
        for u, each in zip(self.u, curvatures, strict=True):
            own = T @ each.V
            one = np.ones(len(triangle(own.shape[1])[0]))
            curved.append(np.sqrt(u) * each.squares(self.active.triangles(own, one)))
        q = self.u / self.c
        values, U = eigenpairs(np.diag(q) - np.outer(q, q) / q.sum())
        among = (np.sqrt(np.maximum(values, 0.0)) * U).T @ self.J
        return weight_equations(np.vstack([*curved, among]), self.s / self.w, most=np.inf)
